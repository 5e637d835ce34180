// The page of a study: shapes by heads, a plot and a table of its runs.

import { pageData } from "page/data.js";
import { showGrid } from "page/grid.js";
import { showPlot } from "page/plot.js";
import { showTable } from "page/table.js";

const data = pageData();
showGrid(data);
showPlot(data);
showTable(data);
document.body.dataset.state = "ready";
