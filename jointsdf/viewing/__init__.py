"""Pictures and mesh files of part-labelled meshes, made on the CPU.

`palette` gives each part its colour everywhere, `render` makes pictures, `export` writes files and TensorBoard arrays.
"""
