"""The yaml files of a run: `jointsdf.conf` of the installed package."""
