"""One run or sweep, from a Hydra config to result rows."""
