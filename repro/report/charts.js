// The values of a chart at the pointer, or at the time of the fields.
"use strict";
const charts = [...document.querySelectorAll("figure[data-chart]")].map(figure => {
  const content = JSON.parse(figure.dataset.chart), [low, high, start, end] = content.axis;
  const within = selector => figure.querySelector(`:scope > ${selector}`);
  return { content, drawing: within("svg"), output: within("output"), now: within("svg .now"),
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

// Linear between a line's own times; null before the first, after the last and beside a gap.
function valueAt(line, time) {
  const k = line.t.findIndex(own => own >= time);
  if (k < 0 || line.t[k] === time) return k < 0 ? null : line.y[line.t.lastIndexOf(time)]; // after a jump
  if (k === 0 || line.y[k] === null || line.y[k - 1] === null) return null;
  return line.y[k - 1] + (time - line.t[k - 1]) / (line.t[k] - line.t[k - 1]) * (line.y[k] - line.y[k - 1]);
}

function mark(chart, time) {
  chart.now.setAttribute("x1", chart.place(time));
  chart.now.setAttribute("x2", chart.place(time));
  chart.now.setAttribute("visibility", "visible");
}

function timeUnder(chart, event) {
  const box = chart.drawing.getBoundingClientRect();
  return chart.time((event.clientX - box.left) / box.width * chart.drawing.viewBox.baseVal.width);
}

// The values at the time, of those that any line has a value for, that is nearest to this one.
function tell(chart, time) {
  const lines = chart.content.lines.filter(line => line.t.length && line.y.some(y => y !== null));
  const times = lines.map(line => line.t[nearest(line.t, time)]), at = times[nearest(times, time)];
  chart.output.textContent = `${rounded(at)} h: ` + lines.map(line =>
    (lines.length > 1 ? line.label + " " : "") + rounded(valueAt(line, at))).join(", ");
  chart.at = at;
  mark(chart, at);
}

let present = null; // the time of the fields shown, h
function tellAll(time) {
  present = time;
  for (const chart of charts) tell(chart, time);
}
function tellNothing(chart) {
  chart.output.textContent = "\u00a0";
  chart.now.setAttribute("visibility", "hidden");
}
// The arrow keys choose the time before or after the one that is shown, Enter its fields.
function step(chart, event) {
  const times = [...new Set(chart.content.lines.flatMap(line => line.t))].sort((a, b) => a - b);
  const k = nearest(times, chart.at ?? times[0]), by = { ArrowLeft: -1, ArrowRight: 1, Enter: 0 }[event.key];
  if (by === undefined) return;
  event.preventDefault();
  tell(chart, times[Math.min(times.length - 1, Math.max(0, k + by))]);
  if (!by) document.dispatchEvent(new CustomEvent("timechosen", { detail: chart.at }));
}
for (const chart of charts) {
  chart.drawing.setAttribute("tabindex", "0");
  chart.drawing.addEventListener("pointermove", event => tell(chart, timeUnder(chart, event)));
  chart.drawing.addEventListener("pointerleave", () => {
    if (present === null) tellNothing(chart); else tell(chart, present);
  });
  chart.drawing.addEventListener("keydown", event => step(chart, event));
  chart.drawing.addEventListener("click", event => {
    document.dispatchEvent(new CustomEvent("timechosen", { detail: timeUnder(chart, event) }));
  });
}
document.documentElement.dataset.charts = charts.length;
