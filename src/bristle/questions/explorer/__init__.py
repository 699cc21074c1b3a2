"""The model in the hand: one self-contained page whose physics is JavaScript that CasADi's own expressions print."""
