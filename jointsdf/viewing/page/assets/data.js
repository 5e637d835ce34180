// The data of the page: JSON, with arrays as gzip in base64 (little-endian, as every current processor).

const TYPES = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i2: Int16Array };

export function pageData() {
  return JSON.parse(document.getElementById("page-data").textContent);
}

// Arrays by name, from {gzip, arrays: [[name, type, first byte, length], ...]}.
export async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.gzip), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  return Object.fromEntries(
    packed.arrays.map(([name, type, start, length]) => [name, new TYPES[type](buffer, start, length)]),
  );
}

// A number with the digits that matter, and the sign of a minus.
export function digits(value, count = 3) {
  if (value === null || Number.isNaN(value)) return "";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(count - 1) : String(Number(value.toPrecision(count)));
  return text.replace("-", "\u2212");
}
