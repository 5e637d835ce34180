"""Triangle meshes: normals and areas, rays, the graph of their faces, exact distances, topology."""
