"""Every figure of a study. Plots of rows are `jointsdf.study`'s; here are the pictures of meshes, and the command."""
