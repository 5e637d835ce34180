"""Triangle meshes: areas and normals, sampling, rays, the graph of their faces, exact distances, topology, PLY."""
