// Fields over time, with axes, a colour bar and a slider.
"use strict";
const data = JSON.parse(document.getElementById("fields").textContent);
const part = Object.fromEntries(["picture", "field", "frame", "now", "probe", "lines", "outline", "whole", "fixed",
  "play", "save"].map(id => [id, document.getElementById(id)]));

function rangeOf(field, frame) {
  const pairs = (part.fixed.checked ? data.frames : [frame]).map(each => each.values[field.name])
    .filter(pair => pair && pair[2]);
  const low = Math.min(...pairs.map(pair => pair[0])), high = Math.max(...pairs.map(pair => pair[1]));
  if (!isFinite(low)) return [0, 0];
  return high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? [low, high] : [low, low];  // round-off is none
}

// Where a value stands between the first and the last colour, and the value at such a share: logarithmic from two
// decades on, over four at most.
function shareOf(low, high) {
  if (!(low > 0 && high >= 100 * low)) {
    const span = high - low;
    return { least: low, log: false, at: value => (value - low) / span, value: share => low + share * span };
  }
  const least = Math.max(low, 1e-4 * high), decades = Math.log(high / least);
  return { least, log: true, at: value => Math.log(Math.max(value, least) / least) / decades,
    value: share => least * Math.exp(share * decades) };
}

// The colours of a range, and the values at which one follows another. One value alone has the colour in the middle.
function scaleOfColours(low, high) {
  const colours = data.colours, shares = shareOf(low, high);
  if (!(high > low)) return { colours: [colours[colours.length >> 1]], limits: [] };
  return { colours, limits: colours.slice(1).map((_, k) => shares.value((k + 1) / colours.length)) };
}

function boxOf(points) {
  if (part.whole.checked) return data.box;
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let k = 0; k < points.length; k += 2) {
    x0 = Math.min(x0, points[k]); x1 = Math.max(x1, points[k]);
    y0 = Math.min(y0, points[k + 1]); y1 = Math.max(y1, points[k + 1]);
  }
  return [x0, x1, y0, y1];
}

// Pixels per um: as wide as the page, but neither higher than the window nor too thin to see.
function scaleOf(box, room) {
  const tallest = Math.max(200, 0.65 * window.innerHeight), least = 60;
  const scale = Math.min(room / (box[1] - box[0]), tallest / (box[3] - box[2]));
  return Math.max(scale, least / (box[3] - box[2]));
}

// Adds an element to a part of the picture.
function add(parent, name, attributes, text) {
  const element = document.createElementNS(part.picture.namespaceURI, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  parent.append(element);
  return element;
}

let drawn = null; // read by the probe
function draw() {
  const frame = data.frames[part.frame.value], field = data.fields.find(each => each.name === part.field.value);
  const mesh = meshOf(data.meshes[frame.mesh]), points = pointsOf(frame, data.box), [low, high] = rangeOf(field, frame);
  const atNodes = field.at === "node";
  const values = valuesOf(frame, field, mesh, atNodes ? points.length / 2 : mesh.body.length);
  const edge = { left: 40, right: 12, top: 8, bottom: 98 }, box = boxOf(points);
  const room = Math.max(120, part.picture.parentElement.clientWidth) - edge.left - edge.right;
  const scale = scaleOf(box, room), across = scale * (box[1] - box[0]), tall = scale * (box[3] - box[2]);
  const wide = Math.max(across, room) + edge.left + edge.right, height = tall + edge.top + edge.bottom;
  const place = (x, y) => [edge.left + (x - box[0]) * scale, edge.top + tall - (y - box[2]) * scale];
  const places = new Float64Array(points.length);
  for (let k = 0; k < points.length; k += 2) [places[k], places[k + 1]] = place(points[k], points[k + 1]);
  const pieces = piecesOf(mesh, places, values, atNodes), filled = areaOf(pieces) / (across * tall);
  part.picture.replaceChildren();
  for (const [key, value] of Object.entries({ width: wide, height: height, viewBox: `0 0 ${wide} ${height}` }))
    part.picture.setAttribute(key, value);
  add(part.picture, "rect", { x: edge.left, y: edge.top, width: across, height: tall, fill: "var(--none)" });
  colour(pieces, low, high);
  if (part.lines.checked) trace(mesh.edges, places, "#808080", 0.7);
  if (part.outline.checked)
    for (const [stroke, width] of [["#ffffff", 3], ["#000000", 1.2]]) trace(mesh.rim, places, stroke, width);
  axes(box, place, tall);
  const long = Math.min(420, room), left = edge.left + Math.max(0, across - long) / 2;
  bar(field, low, high, filled < 0.999, left, edge.top + tall + 52, long);
  const lines = [["#ffffff", 3], ["#000000", 1.2]].map(([stroke, width]) =>
    add(part.picture, "path", { d: "", stroke, "stroke-width": width }));
  drawn = { pieces, filled, edge, scale, tall, across, box, field, lines };
  cross();
  describe(frame, field, low, high);
}

// A colour of the page.
function ink(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

// Fills the pieces. The lines around them close the gaps between bands.
function colour(pieces, low, high) {
  const { colours, limits } = scaleOfColours(low, high);
  const group = add(part.picture, "g", { "class": "bands", "stroke-linejoin": "bevel" });
  bandsOf(pieces, limits).forEach((d, k) => {
    if (d) add(group, "path", { d, fill: colours[k], stroke: colours[k] });
  });
}

function trace(edges, places, stroke, width) {
  const corner = node => `${tenths(places[2 * node])} ${tenths(places[2 * node + 1])}`;
  const control = ({ a, b, middle }) => [0, 1].map(k =>
    tenths(2 * places[2 * middle + k] - (places[2 * a + k] + places[2 * b + k]) / 2)).join(" ");
  const curve = edge => edge.middle < 0 ? "L" : `Q${control(edge)} `;
  const d = edges.map(edge => `M${corner(edge.a)}${curve(edge)}${corner(edge.b)}`).join("");
  add(part.picture, "path", { d, fill: "none", stroke, "stroke-width": width });
}

function roundTicks(low, high, parts) {
  if (!(high > low)) return [low];
  const power = 10 ** Math.floor(Math.log10((high - low) / parts));
  const step = [1, 2, 5, 10].map(k => k * power).find(each => each >= (high - low) / parts * 0.999), ticks = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) ticks.push(k * step);
  return ticks;
}

function write(x, y, text, anchor, more = {}) {
  return add(part.picture, "text", { x, y, "text-anchor": anchor, fill: "var(--text)", ...more }, text);
}

function axes(box, place, tall) {
  const [left, bottom] = place(box[0], box[2]), [right, top] = place(box[1], box[3]);
  const faint = { stroke: "var(--faint)" };
  add(part.picture, "rect", { x: left, y: top, width: right - left, height: bottom - top, fill: "none", ...faint });
  for (const value of roundTicks(box[0], box[1], right - left > 500 ? 10 : 5)) {
    const [x] = place(value, 0);
    add(part.picture, "path", { d: `M${x} ${bottom}v4`, ...faint });
    write(x, bottom + 16, rounded(value), "middle");
  }
  write((left + right) / 2, bottom + 31, "x (um)", "middle");
  for (const value of roundTicks(box[2], box[3], tall > 150 ? 5 : 2)) {
    const [, y] = place(0, value);
    add(part.picture, "path", { d: `M${left} ${y}h-4`, ...faint });
    write(left - 6, y + 4, rounded(value), "end");
  }
  write(0, 0, "y (um)", "middle", { transform: `translate(12 ${(top + bottom) / 2}) rotate(-90)` });
}

// The values beside the bar: round ones, or powers of ten.
function barTicks(low, high, shares) {
  if (!shares.log) return roundTicks(low, high, 4);
  const ticks = [];
  for (let power = Math.ceil(Math.log10(low)); 10 ** power <= high; power++) ticks.push(10 ** power);
  return ticks;
}

function bar(field, least, high, grey, left, top, width) {
  const shares = shareOf(least, high), low = shares.least, { colours } = scaleOfColours(least, high);
  const why = field.body ? "not defined in the fluid" : "not meshed at this time";
  const name = field.label + (field.unit ? ` (${field.unit})` : "") + (shares.log ? ", log scale" : "")
    + (grey ? `; grey: ${why}` : "");
  if (!(high > low)) return void write(left, top + 10, `${name}: ${rounded(low)} everywhere`, "start");
  const group = add(part.picture, "g", { "shape-rendering": "crispEdges" }), step = width / colours.length;
  colours.forEach((fill, k) => add(group, "path", { d: `M${left + k * step} ${top}h${step}v12h${-step}Z`, fill }));
  const text = value => (value === low && low > least ? "\u2264 " : "")
    + rounded(Math.abs(value) < 1e-12 * (high - low) ? 0 : value);
  const wide = value => 6.5 * text(value).length, place = value => left + shares.at(value) * width;
  const first = left + wide(low) + 8, last = left + width - wide(high) - 8; // the ends are exact
  const between = barTicks(low, high, shares).filter(value =>
    place(value) - wide(value) / 2 > first && place(value) + wide(value) / 2 < last);
  for (const value of [low, ...between, high]) {
    add(part.picture, "path", { d: `M${place(value)} ${top + 12}v4`, stroke: "var(--text)" });
    write(place(value), top + 27, text(value), value === low ? "start" : value === high ? "end" : "middle");
  }
  write(left, top + 42, name, "start");
}

// Describes the picture, for the reader and, in data attributes, for a test.
function describe(frame, field, low, high) {
  const text = `t = ${rounded(frame.time)} h${frame.note ? `, ${frame.note}` : ""}`;
  part.now.textContent = `${text} (${Number(part.frame.value) + 1} of ${data.frames.length})`;
  part.frame.setAttribute("aria-valuetext", text);
  const range = `${rounded(low)} to ${rounded(high)} ${field.unit}`;
  part.picture.setAttribute("aria-label", `${field.label}, ${range}, at ${text}`);
  const share = value => high > low ? (value - low) / (high - low) : 0;
  const hashed = (sum, value) => (sum * 31 + Math.round(1e6 * share(value))) % 1000000007;
  Object.assign(part.picture.dataset, { frame: part.frame.value, field: field.name, low, high,
    seen: drawn.pieces.reduce((sum, value, k) => k % 3 === 2 ? hashed(sum, value) : sum, 7), filled: drawn.filled });
  tellAll(frame.time);
}

function probe(event) {
  const frame = part.picture.getBoundingClientRect();
  read(event.clientX - frame.left - drawn.edge.left, event.clientY - frame.top - drawn.edge.top);
}

// Shows the value at a place, in pixels from the upper left corner of the field.
function read(across, down) {
  const { pieces, edge, scale, tall, box, field } = drawn;
  const inside = across >= 0 && down >= 0 && across < drawn.across && down < tall;
  const value = inside ? fieldAt(pieces, edge.left + across, edge.top + down) : NaN;
  const x = (box[0] + across / scale).toFixed(1), y = (box[2] + (tall - down) / scale).toFixed(1);
  const words = isNaN(value) ? "none here" : `${field.label} ${rounded(value)} ${field.unit}`;
  part.probe.textContent = inside ? `x = ${x} um, y = ${y} um: ${words}` : "\u00a0";
}

// The place that the arrow keys move, as shares of the field's width and height; null before the first key.
let cursor = null;
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
function move(event) {
  if (!STEPS[event.key]) return;
  event.preventDefault();
  const size = event.shiftKey ? 0.1 : 0.02, within = value => Math.min(0.999, Math.max(0.001, value));
  cursor = cursor ? cursor.map((value, k) => within(value + size * STEPS[event.key][k])) : [0.5, 0.5];
  cross();
  read(cursor[0] * drawn.across, cursor[1] * drawn.tall);
}

function cross() {
  const [x, y] = cursor ? [drawn.edge.left + cursor[0] * drawn.across, drawn.edge.top + cursor[1] * drawn.tall] : [];
  for (const line of drawn.lines) line.setAttribute("d", cursor ? `M${x - 7} ${y}h14M${x} ${y - 7}v14` : "");
}

// The saved picture has the colours of the page.
function save() {
  const picture = part.picture.cloneNode(true), frame = data.frames[part.frame.value];
  const link = document.createElement("a");
  picture.prepend(add(picture, "rect", { width: "100%", height: "100%", fill: "var(--back)" }));
  const text = new XMLSerializer().serializeToString(picture).replace(/var\((--\w+)\)/g, (_, name) => ink(name));
  link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  link.download = `${part.field.value}_${rounded(frame.time)}h.svg`;
  link.click();
  URL.revokeObjectURL(link.href);
}

// A fragment such as #frame=3&field=theta chooses the frame and the field.
function chosen() {
  const requested = new URLSearchParams(location.hash.slice(1));
  if (data.frames[requested.get("frame")]) part.frame.value = requested.get("frame");
  if (data.fields.some(field => field.name === requested.get("field"))) part.field.value = requested.get("field");
  draw();
}

let timer = null;
function play() {
  part.play.textContent = timer ? "Play" : "Pause";
  if (timer) { clearInterval(timer); timer = null; return; }
  timer = setInterval(() => { part.frame.value = (Number(part.frame.value) + 1) % data.frames.length; draw(); }, 250);
}

for (const field of data.fields) part.field.add(new Option(field.label, field.name));
part.frame.max = data.frames.length - 1;
part.field.value = data.start.field;
part.frame.value = data.start.frame;
for (const id of ["field", "frame", "lines", "outline", "whole", "fixed"]) part[id].addEventListener("input", draw);
part.play.addEventListener("click", play);
part.save.addEventListener("click", save);
part.picture.addEventListener("keydown", move);
part.picture.addEventListener("blur", () => { cursor = null; cross(); });
part.picture.addEventListener("pointermove", probe);
part.picture.addEventListener("pointerleave", () => { part.probe.textContent = "\u00a0"; });
document.addEventListener("timechosen", event => {
  part.frame.value = nearest(data.frames.map(frame => frame.note ? Infinity : frame.time), event.detail);
  draw();
});
window.addEventListener("hashchange", chosen);
window.addEventListener("resize", draw);
window.addEventListener("load", () => { // the middle, where the aggregate is
  const around = part.picture.parentElement;
  around.scrollLeft = (around.scrollWidth - around.clientWidth) / 2;
});
chosen();
document.documentElement.dataset.fields = data.fields.length;
