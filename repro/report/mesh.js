// Triangles of three or six nodes with one value for each node or triangle, and the pixels that they cover.
"use strict";
const LEVELS = 65534, PIECES = 4;
// viridis
const STOPS = [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137],
  [53, 183, 121], [109, 205, 89], [180, 222, 44], [253, 231, 37]];

function bytes(text) { return Uint8Array.from(atob(text), letter => letter.charCodeAt(0)); }
function shorts(text) { const raw = bytes(text); return new Uint16Array(raw.buffer); }

function colour(share) {
  const place = Math.min(1, Math.max(0, share)) * (STOPS.length - 1), k = Math.min(STOPS.length - 2, Math.floor(place));
  return STOPS[k].map((from, c) => from + (place - k) * (STOPS[k + 1][c] - from));
}
const TABLE = Array.from({ length: 256 }, (_, k) => {
  const [r, g, b] = colour(k / 255);
  return (255 << 24 | Math.round(b) << 16 | Math.round(g) << 8 | Math.round(r)) >>> 0;
});

// A mesh: cells, which of them are of the aggregate, its nodes and triangles in ascending order, and
// its edge with the fluid.
function meshOf(stored) {
  if (stored.ready) return stored.ready;
  const cells = new Uint32Array(bytes(stored.cells).buffer), body = bytes(stored.body), per = stored.per;
  const nodes = new Set(), triangles = [], sides = new Map();
  for (let t = 0; t < body.length; t++) {
    if (body[t]) triangles.push(t);
    for (let i = 0; i < per; i++) if (body[t]) nodes.add(cells[t * per + i]);
    for (let i = 0; i < 3; i++) {
      const a = cells[t * per + i], b = cells[t * per + (i + 1) % 3], key = Math.min(a, b) + "," + Math.max(a, b);
      const middle = per === 6 ? cells[t * per + 3 + i] : -1;
      if (!sides.has(key)) sides.set(key, { a, b, middle, of: [] });
      sides.get(key).of.push(body[t]);
    }
  }
  const edges = [...sides.values()];
  stored.ready = { cells, body, per, nodes: Uint32Array.from(nodes).sort(), triangles, edges,
    rim: edges.filter(edge => edge.of.length === 2 && edge.of[0] !== edge.of[1]) };
  return stored.ready;
}

// Coordinates of the nodes, um.
function pointsOf(frame, [x0, x1, y0, y1]) {
  const raw = shorts(frame.points), points = new Float64Array(raw.length);
  for (let k = 0; k < raw.length; k += 2) {
    points[k] = x0 + raw[k] / LEVELS * (x1 - x0);
    points[k + 1] = y0 + raw[k + 1] / LEVELS * (y1 - y0);
  }
  return points;
}

// One value for each node or triangle; NaN for none.
function valuesOf(frame, field, mesh, count) {
  const [low, high, text] = frame.values[field.name], raw = shorts(text);
  const nodal = new Float64Array(count).fill(NaN);
  const places = field.body ? field.at === "node" ? mesh.nodes : mesh.triangles : null;
  raw.forEach((level, k) => {
    if (level <= LEVELS) nodal[places ? places[k] : k] = low + level / LEVELS * (high - low);
  });
  return nodal;
}

// Weights of a triangle's nodes at the corners (a, b) of its PIECES x PIECES parts.
function weights(per, a, b) {
  const c = 1 - a - b;
  return per === 3 ? [c, a, b] : [c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * c * a, 4 * a * b, 4 * b * c];
}
const PARTS = { 3: [[[0, 0], [1, 0], [0, 1]]], 6: [] };
for (let i = 0; i < PIECES; i++) for (let j = 0; i + j < PIECES; j++) {
  const at = (p, q) => [p / PIECES, q / PIECES];
  PARTS[6].push([at(i, j), at(i + 1, j), at(i, j + 1)]);
  if (i + j < PIECES - 1) PARTS[6].push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
}
for (const per of [3, 6]) PARTS[per] = PARTS[per].map(piece => piece.map(([a, b]) => weights(per, a, b)));

// Every pixel's value (Float64Array, NaN outside); places in pixels.
function filled(mesh, places, values, atNodes, width, height) {
  const pixels = new Float64Array(width * height).fill(NaN), corner = new Float64Array(9);
  for (let t = 0; t < mesh.body.length; t++) for (const piece of PARTS[mesh.per]) {
    for (let v = 0; v < 3; v++) {
      let x = 0, y = 0, value = 0;
      piece[v].forEach((weight, i) => {
        const node = mesh.cells[t * mesh.per + i];
        x += weight * places[2 * node]; y += weight * places[2 * node + 1];
        if (atNodes) value += weight * values[node];
      });
      corner[3 * v] = x; corner[3 * v + 1] = y; corner[3 * v + 2] = atNodes ? value : values[t];
    }
    if (!isNaN(corner[2] + corner[5] + corner[8])) fill(pixels, width, height, corner);
  }
  return pixels;
}

function fill(pixels, width, height, [ax, ay, av, bx, by, bv, cx, cy, cv]) {
  const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
  if (!area) return;
  const slack = -1e-6, top = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5));
  const bottom = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
  const left = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5));
  const right = Math.min(width - 1, Math.floor(Math.max(ax, bx, cx) - 0.5));
  for (let row = top; row <= bottom; row++) for (let column = left; column <= right; column++) {
    const x = column + 0.5, y = row + 0.5;
    const b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area;
    const c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area;
    if (b >= slack && c >= slack && 1 - b - c >= slack)
      pixels[row * width + column] = av + b * (bv - av) + c * (cv - av);
  }
}
