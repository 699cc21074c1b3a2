"""The equations of LuGre and the DC motor as CasADi expressions, and what is derived from them."""
