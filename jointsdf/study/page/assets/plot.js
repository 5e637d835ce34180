// A point per run over two measures; pointing at one (or the Tab key) names its run.

import { digits } from "page/data.js";
import { drawn, element, runName } from "page/elements.js";

const byId = (id) => document.getElementById(id);
const FRAME = { left: 80, right: 880, top: 20, bottom: 360 };

// Round numbers between two values, about five.
function ticks(low, high) {
  const rough = (high - low) / 5 || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k++) found.push(k * step);
  return found;
}

// An axis from the values: logarithmic where they are positive and over two decades.
function axis(values, from, to) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const logarithmic = low > 0 && high / low > 100;
  const bend = logarithmic ? Math.log10 : (value) => value;
  const [a, b] = [bend(low), bend(high)];
  const margin = (b - a || Math.abs(b) || 1) * 0.05;
  const place = (value) => from + ((bend(value) - a + margin) / (b - a + 2 * margin)) * (to - from);
  const marks = logarithmic ? ticks(Math.floor(a), Math.ceil(b)).map((power) => 10 ** power).filter((value) => value >= low && value <= high) : ticks(low, high);
  return { place, marks };
}

export function showPlot(data) {
  const [svg, tip] = [byId("plot"), byId("plot-tip")];
  const key = data.columns.map((column) => {
    const swatch = element("span", { class: "swatch" });
    Object.assign(swatch.style, { display: "inline-block", background: data.colours[column], marginRight: "0.3rem" });
    return element("span", {}, swatch, column);
  });
  byId("plot-key").replaceChildren(...key);
  const update = () => {
    const [x, y] = ["plot-x", "plot-y"].map((id) => Number(byId(id).value));
    const shown = data.runs.filter((run) => [x, y].every((k) => run.values[k] !== null));
    svg.replaceChildren();
    if (!shown.length) { svg.append(drawn("text", { x: 450, y: 200, "text-anchor": "middle" }, "no run has both numbers")); return; }
    const across = axis(shown.map((run) => run.values[x]), FRAME.left, FRAME.right);
    const up = axis(shown.map((run) => run.values[y]), FRAME.bottom, FRAME.top);
    for (const mark of across.marks) {
      svg.append(drawn("line", { x1: across.place(mark), x2: across.place(mark), y1: FRAME.top, y2: FRAME.bottom }));
      svg.append(drawn("text", { x: across.place(mark), y: FRAME.bottom + 20, "text-anchor": "middle" }, digits(mark, 6)));
    }
    for (const mark of up.marks) {
      svg.append(drawn("line", { x1: FRAME.left, x2: FRAME.right, y1: up.place(mark), y2: up.place(mark) }));
      svg.append(drawn("text", { x: FRAME.left - 8, y: up.place(mark) + 4, "text-anchor": "end" }, digits(mark, 6)));
    }
    svg.append(drawn("text", { x: (FRAME.left + FRAME.right) / 2, y: FRAME.bottom + 46, "text-anchor": "middle" }, data.measures[x].words));
    svg.append(drawn("text", { x: 0, y: 0, "text-anchor": "middle", transform: `translate(18 ${(FRAME.top + FRAME.bottom) / 2}) rotate(-90)` }, data.measures[y].words));
    for (const run of shown) {
      const label = `${runName(run)}\n${data.measures[x].words}: ${digits(run.values[x], 4)}\n${data.measures[y].words}: ${digits(run.values[y], 4)}`;
      const point = drawn("circle", { class: "point", cx: across.place(run.values[x]), cy: up.place(run.values[y]), r: 5, fill: data.colours[run.column], tabindex: 0, role: "img", "aria-label": label });
      const say = () => { tip.textContent = label; tip.hidden = false; tip.classList.toggle("right", across.place(run.values[x]) < 450); };
      point.addEventListener("pointerenter", say);
      point.addEventListener("focus", say);
      point.addEventListener("pointerleave", () => { tip.hidden = true; });
      point.addEventListener("click", () => { if (data.pages[run.shape]) location.href = data.pages[run.shape]; });
      svg.append(point);
    }
  };
  ["plot-x", "plot-y"].forEach((id) => byId(id).addEventListener("change", update));
  update();
}
