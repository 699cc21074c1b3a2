"""The equations, once: LuGre and the DC motor as pure CasADi expressions, and what is derived from them."""
