"""What the package claims of its speed, measured here: `make bench`. Each file says what it compares with."""
