// A part-labelled surface, or points: one object per part, in the file frame about the middle of the ground truth.

import * as THREE from "three";
import { linear } from "page/colours.js";

const SMOOTH = Math.cos((32 * Math.PI) / 180); // faces that turn by less are shaded as one, as no crease is between them

// Corners of a packed surface: its vertices are 16-bit steps of a box.
function places(arrays, box, middle) {
  const found = new Float32Array(arrays.vertices.length);
  for (let k = 0; k < found.length; k++) {
    const axis = k % 3;
    found[k] = box.low[axis] - middle[axis] + arrays.vertices[k] * box.step[axis];
  }
  return found;
}

function faceNormals(vertices, faces) {
  const normals = new Float32Array(faces.length);
  const [a, b, c] = [0, 1, 2].map(() => new THREE.Vector3());
  for (let f = 0; f < faces.length; f += 3) {
    [a, b, c].forEach((corner, k) => corner.fromArray(vertices, 3 * faces[f + k]));
    b.sub(a).cross(c.sub(a)).toArray(normals, f); // twice the area long
  }
  return normals;
}

// Normal at each corner: the mean of the faces at its vertex that no crease separates from the corner's own.
function cornerNormals(vertices, faces) {
  const normals = faceNormals(vertices, faces);
  const starts = new Uint32Array(vertices.length / 3 + 1);
  for (const vertex of faces) starts[vertex + 1]++;
  for (let v = 1; v < starts.length; v++) starts[v] += starts[v - 1];
  const next = starts.slice();
  const around = new Uint32Array(faces.length);
  for (let k = 0; k < faces.length; k++) around[next[faces[k]]++] = Math.floor(k / 3);
  const found = new Float32Array(3 * faces.length);
  const [own, other, sum] = [0, 1, 2].map(() => new THREE.Vector3());
  for (let k = 0; k < faces.length; k++) {
    own.fromArray(normals, 3 * Math.floor(k / 3));
    const length = own.length();
    sum.set(0, 0, 0);
    for (let n = starts[faces[k]]; n < starts[faces[k] + 1]; n++) {
      other.fromArray(normals, 3 * around[n]);
      if (other.dot(own) >= SMOOTH * other.length() * length) sum.add(other);
    }
    sum.normalize().toArray(found, 3 * k);
  }
  return found;
}

export class Surface {
  // `packed` says name, kind (mesh or points) and box; `arrays` are its unpacked arrays, `layer` the panel's number.
  constructor(packed, arrays, parts, middle, layer, materials) {
    Object.assign(this, { packed, arrays, layer, group: new THREE.Group(), pieces: [] });
    const vertices = places(arrays, packed.box, middle);
    if (packed.kind === "points") this.addPoints(vertices, parts, materials);
    else this.addFaces(vertices, parts, materials);
    this.group.traverse((object) => object.layers.set(layer));
  }

  addFaces(vertices, parts, materials) {
    const { faces, parts: partOf } = this.arrays;
    const normals = cornerNormals(vertices, faces);
    for (let part = 0; part < parts.length; part++) {
      const own = Array.from(partOf.keys()).filter((face) => partOf[face] === part);
      if (!own.length) continue;
      const corners = Uint32Array.from(own.flatMap((face) => [3 * face, 3 * face + 1, 3 * face + 2]));
      const geometry = new THREE.BufferGeometry();
      const at = (array, of) => Float32Array.from({ length: 3 * corners.length }, (_, k) => array[3 * of(corners[Math.floor(k / 3)]) + (k % 3)]);
      geometry.setAttribute("position", new THREE.BufferAttribute(at(vertices, (corner) => faces[corner]), 3));
      geometry.setAttribute("normal", new THREE.BufferAttribute(at(normals, (corner) => corner), 3));
      const mesh = new THREE.Mesh(geometry, materials.surface);
      mesh.add(new THREE.Mesh(geometry, materials.wire));
      mesh.add(this.linesOf(part, vertices, materials));
      mesh.children.forEach((child) => { child.raycast = () => {}; });
      this.addPiece(mesh, part, own, corners.map((corner) => faces[corner]));
    }
  }

  linesOf(part, vertices, materials) {
    const { lines, line_parts: partOf } = this.arrays;
    const own = Array.from(partOf.keys()).filter((line) => partOf[line] === part);
    const ends = Float32Array.from(own.flatMap((line) => [0, 1, 2, 3, 4, 5].map((k) => vertices[3 * lines[2 * line + (k > 2)] + (k % 3)])));
    return new THREE.LineSegments(new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(ends, 3)), materials.crease);
  }

  addPoints(vertices, parts, materials) {
    for (let part = 0; part < parts.length; part++) {
      const own = Array.from(this.arrays.parts.keys()).filter((point) => this.arrays.parts[point] === part);
      if (!own.length) continue;
      const geometry = new THREE.BufferGeometry();
      const chosen = Float32Array.from({ length: 3 * own.length }, (_, k) => vertices[3 * own[Math.floor(k / 3)] + (k % 3)]);
      geometry.setAttribute("position", new THREE.BufferAttribute(chosen, 3));
      this.addPiece(new THREE.Points(geometry, materials.points), part, own, Uint32Array.from(own));
    }
  }

  // A piece is the object of a part, the faces (or points) in it, and the vertex of each of its corners.
  addPiece(object, part, faces, corners) {
    object.geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * corners.length), 3));
    object.geometry.computeBoundingBox();
    const middle = object.geometry.boundingBox.getCenter(new THREE.Vector3());
    this.pieces.push({ surface: this, object, part, faces, corners, middle });
    object.userData.piece = this.pieces.at(-1);
    this.group.add(object);
  }

  // Colour every corner: `colour(face, vertex, part)` gives sRGB bytes.
  paint(colour) {
    for (const { object, part, faces, corners } of this.pieces) {
      const target = object.geometry.getAttribute("color");
      const each = corners.length / faces.length;
      for (let k = 0; k < corners.length; k++) {
        target.array.set(linear(colour(faces[Math.floor(k / each)], corners[k], part)), 3 * k);
      }
      target.needsUpdate = true;
    }
  }
}
