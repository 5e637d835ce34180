// The rows of a study; a header sorts by its column, worst first, then the other way.

import { digits } from "page/data.js";
import { element } from "page/elements.js";

export function showTable(data) {
  const table = document.getElementById("rows");
  const named = [["shape", (run) => run.shape], ["head", (run) => run.column], ["seed", (run) => run.seed], ["status", (run) => run.status]];
  const measured = data.measures.map((measure, k) => [measure.words, (run) => run.values[k], measure.goal]);
  const columns = [...named, ...measured];
  let sorted = { column: named.length, worst: true };
  const compare = ([, value, goal], a, b) => {
    const [one, other] = [value(a), value(b)];
    if (one === null || other === null) return (one === null) - (other === null); // blanks last, either way
    const order = typeof one === "string" ? one.localeCompare(other, undefined, { numeric: true }) : goal === "low" ? other - one : one - other;
    return sorted.worst ? order : -order;
  };
  const line = (run) => element("tr", {}, ...columns.map(([, value, goal], k) => {
    const text = goal ? digits(value(run), 4) : String(value(run));
    return element("td", goal ? { class: "number" } : {}, k === 0 && data.pages[run.shape] ? element("a", { href: data.pages[run.shape] }, text) : text);
  }));
  const update = () => {
    const heads = columns.map(([name, , goal], k) => {
      const button = element("button", { type: "button" }, name);
      button.addEventListener("click", () => { sorted = { column: k, worst: sorted.column === k ? !sorted.worst : true }; update(); });
      const rising = (goal !== "low") === sorted.worst;
      return element("th", { scope: "col", class: goal ? "number" : null, "aria-sort": sorted.column === k ? (rising ? "ascending" : "descending") : null }, button);
    });
    const focused = [...table.tHead.querySelectorAll("button")].indexOf(document.activeElement);
    table.tHead.replaceChildren(element("tr", {}, ...heads));
    table.tHead.querySelectorAll("button")[focused]?.focus();
    table.tBodies[0].replaceChildren(...[...data.runs].sort((a, b) => compare(columns[sorted.column], a, b)).map(line));
  };
  update();
}
