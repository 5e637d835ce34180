// What is known of the place under the pointer, as lines of text in file units.

import * as THREE from "three";
import { digits } from "page/data.js";

const SIGNED = (value) => (value > 0 ? "+" : "") + digits(value);

// Value at a place of a face, between those at its corners.
function interpolate(piece, face, point, value) {
  const corners = [0, 1, 2].map((k) => piece.corners[3 * face + k]);
  const position = piece.object.geometry.getAttribute("position");
  const [a, b, c] = [0, 1, 2].map((k) => new THREE.Vector3().fromBufferAttribute(position, 3 * face + k).add(piece.object.position));
  const weights = THREE.Triangle.getBarycoord(point, a, b, c, new THREE.Vector3());
  return weights ? weights.toArray().reduce((sum, weight, k) => sum + weight * value(corners[k]), 0) : value(corners[0]);
}

function place(point, data) {
  return "xyz".split("").map((axis, k) => `${axis} ${digits(point.getComponent(k) + data.middle[k], 5)}`).join("  ") + ` ${data.unit}`;
}

// `hit` as of Views.pick; gives {part, lines}.
export function reading(hit, data, colouring) {
  const { piece, grid } = hit.object.userData;
  if (grid) {
    return { part: null, lines: [`${data.surfaces[hit.panel].name}: plane`, `field ${SIGNED(grid.at(hit.point))} ${data.unit}`, place(hit.point, data)] };
  }
  const { surface, part } = piece;
  const drawn = hit.face ?? hit.index;
  const face = piece.faces[drawn];
  const value = (vertex) => colouring.error(surface, vertex);
  const error = hit.face === null ? value(piece.corners[drawn]) : interpolate(piece, hit.face, hit.point, value);
  const normal = colouring.normal(surface, face);
  const at = hit.point.clone().sub(piece.object.position);
  const lines = [`${surface.packed.name}: ${data.parts[part].name}`];
  if (!Number.isNaN(error)) lines.push(`error ${SIGNED(error)} ${data.unit}`);
  if (!Number.isNaN(normal)) lines.push(`normal off by ${digits(normal)}\u00b0`);
  if (colouring.wrong(surface, face)) lines.push("wrong label");
  lines.push(place(at, data));
  return { part, lines };
}
