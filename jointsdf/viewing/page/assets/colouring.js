// Colours of the surfaces by part, signed error, wrong labels, normal deviation or head, with their legend.

import { digits } from "page/data.js";
import { RIGHT, WRONG, gradient, hexBytes, scaleColour } from "page/colours.js";

const byId = (id) => document.getElementById(id);
const UNKNOWN = [150, 150, 150];
const DIM = 0.72; // how far parts that are not picked go towards grey

export class Colouring {
  constructor(data, surfaces, request) {
    Object.assign(this, { data, surfaces, request, picked: null });
    document.querySelectorAll("input[name=colour]").forEach((radio) => radio.addEventListener("change", () => this.update()));
    byId("clip").addEventListener("input", () => this.update());
    byId("against")?.addEventListener("change", () => this.update());
    this.update();
  }

  get mode() {
    return document.querySelector("input[name=colour]:checked").value;
  }

  // The ends of the scale: a slider over three decades below the largest error of any surface.
  get end() {
    const share = 10 ** (3 * (Number(byId("clip").value) - 1));
    return (this.mode === "normal" ? 90 : this.data.largest) * share;
  }

  // The arrays in which a surface's errors stand: its own, or of the ground truth those towards the chosen fit.
  errors(surface) {
    if (surface.packed.role === "fit") return surface;
    const fit = this.surfaces.filter((other) => other.packed.role === "fit")[Number(byId("against")?.value ?? 0)];
    return fit && { packed: fit.packed, arrays: { error: fit.arrays.missed, normal: fit.arrays.missed_normal, wrong: fit.arrays.missed_wrong } };
  }

  // Signed error at a vertex, file units; normal deviation of a face, degrees; NaN where there is none.
  error(surface, vertex) {
    const from = this.errors(surface);
    return from?.arrays.error ? from.arrays.error[vertex] * from.packed.error_step : NaN;
  }

  normal(surface, face) {
    const from = this.errors(surface);
    return from?.arrays.normal ? from.arrays.normal[face] * 0.01 : NaN;
  }

  wrong(surface, face) {
    return this.errors(surface)?.arrays.wrong?.[face] ?? 0;
  }

  colour(surface) {
    const { mode, end } = this;
    const parts = this.data.parts.map((part) => hexBytes(part.colour));
    const own = surface.packed.colour ? hexBytes(surface.packed.colour) : UNKNOWN;
    const scaled = (name, value, share) => (Number.isNaN(value) ? UNKNOWN : scaleColour(name, share));
    const plain = {
      part: (face, vertex, part) => (surface.arrays.own ? surface.arrays.own.subarray(3 * face, 3 * face + 3) : parts[part]),
      error: (face, vertex) => { const value = this.error(surface, vertex); return scaled("diverging", value, 0.5 + value / end / 2); },
      wrong: (face) => (this.wrong(surface, face) ? WRONG : RIGHT),
      normal: (face) => { const value = this.normal(surface, face); return scaled("bend", value, value / end); },
      head: () => own,
    }[mode];
    if (this.picked === null) return plain;
    const grey = (bytes) => Array.from(bytes, (byte) => byte + DIM * (190 - byte));
    return (face, vertex, part) => (part === this.picked ? plain(face, vertex, part) : grey(plain(face, vertex, part)));
  }

  update() {
    for (const surface of this.surfaces) surface.paint(this.colour(surface));
    this.legend();
    this.request();
  }

  legend() {
    const { mode, end, data } = this;
    const scale = mode === "error" ? "diverging" : mode === "normal" ? "bend" : null;
    byId("scale").hidden = scale === null;
    byId("clip").disabled = scale === null;
    if (scale) {
      byId("scale-bar").style.background = gradient(scale);
      byId("scale-low").textContent = mode === "error" ? `\u2212${digits(end)} ${data.unit}` : "0\u00b0";
      byId("scale-middle").textContent = mode === "error" ? "0" : "";
      byId("scale-high").textContent = mode === "error" ? `+${digits(end)} ${data.unit}` : `${digits(end)}\u00b0 and more`;
    }
    byId("legend-text").textContent = data.legends[mode];
  }
}
