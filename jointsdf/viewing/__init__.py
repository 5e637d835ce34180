"""Viewing: pictures, mesh files and TensorBoard arrays of part-labelled meshes, made on the CPU.

`palette` has the colour of each part, `raycast` and `render` make pictures, `export` writes files and arrays.
"""
