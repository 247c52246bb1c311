// What a pointer is told on a chart, and the present time of the fields in every chart.
"use strict";
const charts = [...document.querySelectorAll("figure[data-chart]")].map(figure => {
  const told = JSON.parse(figure.dataset.chart), [low, high, start, end] = told.axis;
  const within = selector => figure.querySelector(`:scope > ${selector}`);
  return { told, drawing: within("svg"), output: within("output"), now: within("svg .now"),
    place: time => start + (time - low) / (high - low) * (end - start),
    time: place => low + (place - start) / (end - start) * (high - low) };
});

function rounded(value) {
  if (value === null || !isFinite(value)) return "none";
  const size = Math.abs(value);
  if (value !== 0 && (size < 1e-3 || size >= 1e6)) return Number(value.toPrecision(4)).toExponential();
  return String(Number(value.toPrecision(5)));
}

function nearest(times, time) {
  let best = 0;
  for (let k = 1; k < times.length; k++) if (Math.abs(times[k] - time) < Math.abs(times[best] - time)) best = k;
  return best;
}

function mark(chart, time) {
  const place = chart.place(time), seen = time >= chart.told.axis[0] && time <= chart.told.axis[1];
  chart.now.setAttribute("x1", place);
  chart.now.setAttribute("x2", place);
  chart.now.setAttribute("visibility", seen ? "visible" : "hidden");
}

function timeUnder(chart, event) {
  const box = chart.drawing.getBoundingClientRect();
  return chart.time((event.clientX - box.left) / box.width * chart.drawing.viewBox.baseVal.width);
}

function tell(chart, event) {
  const time = timeUnder(chart, event);
  const lines = chart.told.lines.filter(line => line.t.length && line.y.some(y => y !== null));
  const found = lines.map(line => [line, nearest(line.t, time)]);
  const at = found.reduce((best, [line, k]) => Math.abs(line.t[k] - time) < Math.abs(best - time) ? line.t[k] : best,
    found[0][0].t[found[0][1]]);
  chart.output.textContent = `${rounded(at)} h: ` + found.map(([line, k]) =>
    (lines.length > 1 ? line.label + " " : "") + rounded(line.y[k])).join(", ");
  mark(chart, at);
}

let present = null; // the time of the fields shown, h
function markAll(time) {
  present = time;
  for (const chart of charts) mark(chart, time);
}
for (const chart of charts) {
  chart.drawing.addEventListener("pointermove", event => tell(chart, event));
  chart.drawing.addEventListener("pointerleave", () => {
    chart.output.textContent = "\u00a0";
    if (present === null) chart.now.setAttribute("visibility", "hidden"); else mark(chart, present);
  });
  chart.drawing.addEventListener("click", event => {
    document.dispatchEvent(new CustomEvent("timechosen", { detail: timeUnder(chart, event) }));
  });
}
document.documentElement.dataset.charts = charts.length;
