// A plane normal to an axis: it clips the surfaces, and shows the field in it with its isolines.

import * as THREE from "three";

const VERTEX = `
out vec3 place;
void main() {
  place = (modelMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;
// The grid's values at texel centres, interpolated by the texture unit; isolines as wide on the screen everywhere.
const FRAGMENT = `
uniform highp sampler3D grid;
uniform vec3 low, high, ink, inside, outside;
uniform float spacing;
in vec3 place;
out vec4 colour;
float line(float level, float width) { return 1.0 - smoothstep(width - 0.5, width + 0.5, abs(level)); } // pixels
void main() {
  vec3 count = vec3(textureSize(grid, 0));
  vec3 share = (place - low) / (high - low);
  if (any(lessThan(share, vec3(-1e-4))) || any(greaterThan(share, vec3(1.0001)))) discard;
  float value = texture(grid, (share * (count - 1.0) + 0.5) / count).r / spacing;
  float pixel = fwidth(value);
  float lines = max(0.55 * line((fract(value + 0.5) - 0.5) / pixel, 0.6), line(value / pixel, 1.4));
  colour = vec4(mix(value < 0.0 ? inside : outside, ink, lines), 1.0);
}`;

// Values of a packed grid, file units: the signed square of a byte's distance from the middle.
function gridValues(packed, bytes) {
  return Float32Array.from(bytes, (byte) => {
    const share = (byte - 128) / 127;
    return packed.largest * share * Math.abs(share);
  });
}

export class FieldGrid {
  constructor(packed, arrays, middle) {
    const values = gridValues(packed, arrays.values);
    Object.assign(this, { packed, values, count: packed.count });
    this.low = new THREE.Vector3(...packed.low).sub(middle);
    this.high = new THREE.Vector3(...packed.high).sub(middle);
    const halves = Uint16Array.from(values, (value) => THREE.DataUtils.toHalfFloat(value / packed.largest));
    this.texture = new THREE.Data3DTexture(halves, this.count, this.count, this.count);
    Object.assign(this.texture, { format: THREE.RedFormat, type: THREE.HalfFloatType, unpackAlignment: 1 });
    Object.assign(this.texture, { minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter, needsUpdate: true });
  }

  covers(place) {
    return new THREE.Box3(this.low, this.high).expandByScalar(1e-6 * this.packed.largest).containsPoint(place);
  }

  // The field at a place within, by trilinear interpolation.
  at(place) {
    const share = place.clone().sub(this.low).divide(this.high.clone().sub(this.low)).multiplyScalar(this.count - 1);
    const cell = share.toArray().map((value) => Math.min(Math.max(Math.floor(value), 0), this.count - 2));
    const within = share.toArray().map((value, axis) => value - cell[axis]);
    let sum = 0;
    for (let corner = 0; corner < 8; corner++) {
      const bits = [corner & 1, (corner >> 1) & 1, corner >> 2];
      const weight = bits.reduce((product, bit, axis) => product * (bit ? within[axis] : 1 - within[axis]), 1);
      const [x, y, z] = cell.map((value, axis) => value + bits[axis]);
      sum += weight * this.values[(z * this.count + y) * this.count + x];
    }
    return sum;
  }

  sheet(spacing, layer, colours) {
    const uniforms = Object.fromEntries(
      Object.entries({ grid: this.texture, low: this.low, high: this.high, spacing: spacing / this.packed.largest, ...colours })
        .map(([name, value]) => [name, { value }]),
    );
    const material = new THREE.ShaderMaterial({ uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT });
    Object.assign(material, { glslVersion: THREE.GLSL3, side: THREE.DoubleSide, polygonOffset: true });
    const size = this.high.clone().sub(this.low);
    this.mesh = new THREE.Mesh(new THREE.PlaneGeometry(Math.max(...size), Math.max(...size)), material);
    this.mesh.userData.grid = this;
    this.mesh.layers.set(layer);
    this.mesh.visible = false;
    return this.mesh;
  }

  // Put the sheet at a coordinate along an axis.
  move(axis, place) {
    const centre = this.low.clone().add(this.high).multiplyScalar(0.5).setComponent(axis, place);
    this.mesh.position.copy(centre);
    this.mesh.rotation.set(axis === 1 ? Math.PI / 2 : 0, axis === 0 ? Math.PI / 2 : 0, 0);
  }
}
