"""Measurements behind the speed that the package claims: `make bench`. Each file says what it compares with."""
