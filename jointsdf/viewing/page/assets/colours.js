// Colours of values: sRGB bytes. The scales are readable with any colour vision.

// ColorBrewer's RdBu, reversed: too little material blue, too much red; and cividis (Nunez, Anderton, Renslow, 2018).
const DIVERGING = "2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b";
const SEQUENTIAL = "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838";
export const RIGHT = [222, 222, 222];
export const WRONG = [213, 94, 0];

const BEND = "f7f7f7 fee8b6 fec44f fe9929 ec7014 b34a02 662506"; // after ColorBrewer's YlOrBr
const stops = (text) => text.split(" ").map(hexBytes);
const SCALES = { diverging: stops(DIVERGING), sequential: stops(SEQUENTIAL), bend: stops(BEND) };

export function hexBytes(hex) {
  const number = parseInt(hex.replace("#", ""), 16);
  return [number >> 16, (number >> 8) & 255, number & 255];
}

// Colour of a share from 0 to 1, clipped outside.
export function scaleColour(name, share) {
  const scale = SCALES[name];
  const place = Math.min(Math.max(share, 0), 1) * (scale.length - 1);
  const below = Math.min(Math.floor(place), scale.length - 2);
  return scale[below].map((from, k) => from + (scale[below + 1][k] - from) * (place - below));
}

export function gradient(name) {
  return `linear-gradient(to right, ${SCALES[name].map((colour) => `rgb(${colour.join(" ")})`).join(", ")})`;
}

const LINEAR = Float32Array.from({ length: 256 }, (_, byte) => {
  const value = byte / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
});

// sRGB bytes as the linear values that the renderer shades.
export const linear = (bytes) => bytes.map((byte) => LINEAR[Math.round(byte)]);
