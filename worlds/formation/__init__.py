"""Micro aerial vehicles that agents steer, `kind: formation`, Nägeli 2014."""
