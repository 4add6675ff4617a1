"use strict";
// The map of the index: reported places on an equirectangular drawing, true to scale at its middle latitude, with the
// outlines of the states, a graticule and a scale bar. Crashes near each other on the screen share a ring; choosing it zooms in.
window.crashMap = (figure, pick, moved) => {
  const SVG = "http://www.w3.org/2000/svg";
  const NEAR_PX = 56, MARGIN_PX = 48, LEAST_SPAN_DEG = 0.01, DEG_M = 111195;
  const STATES = ["verified", "first_event_only", "rejected", "failed", "pending"];
  const svg = figure.querySelector("svg");
  let crashes = [];
  let view = { lat: 0, lon: 0, scale: 1 }; // middle, and pixels per degree of latitude

  const make = (name, attributes, parent) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (parent) parent.append(element);
    return element;
  };
  // All states as one path in degrees, which is moved and scaled with the view.
  const land = make("path", { class: "land", "vector-effect": "non-scaling-stroke", d: (({ unitsPerDeg, arcs, rings }) => {
    const places = arcs.map((steps) => {
      let x = 0, y = 0;
      return Array.from({ length: steps.length / 2 }, (_, i) => [x += steps[2 * i], y += steps[2 * i + 1]]);
    });
    const along = (arc) => (arc < 0 ? places[~arc].toReversed() : places[arc]);
    const degrees = ([x, y]) => `${x / unitsPerDeg} ${y / unitsPerDeg}`;
    return rings.map((ring) => `M${ring.flatMap(along).map(degrees).join("L")}z`).join("");
  })(window.stateOutlines) });
  const size = () => ({ width: svg.clientWidth || 900, height: svg.clientHeight || 400 });
  const shrink = () => Math.cos(view.lat * Math.PI / 180);
  const toScreen = (lat, lon) => {
    const { width, height } = size();
    return [width / 2 + (lon - view.lon) * shrink() * view.scale, height / 2 - (lat - view.lat) * view.scale];
  };
  const words = (text) => String(text).replaceAll("_", " ");
  const range = (values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];

  function fit(some) {
    if (!some.length) return;
    const { width, height } = size();
    const [south, north] = range(some.map((crash) => crash.latitude_deg));
    const [west, east] = range(some.map((crash) => crash.longitude_deg));
    view.lat = (south + north) / 2;
    view.lon = (west + east) / 2;
    view.scale = Math.min((height - 2 * MARGIN_PX) / Math.max(north - south, LEAST_SPAN_DEG),
      (width - 2 * MARGIN_PX) / (Math.max(east - west, LEAST_SPAN_DEG) * shrink()));
  }

  const radiusOf = (group) => (group.crashes.length === 1 ? 7 : 15 + 1.5 * Math.log2(group.crashes.length));

  // Greedy: every crash joins the first group whose beginning is near on the screen, and rings that overlap become one.
  function groups() {
    const { width, height } = size();
    const found = [], cells = new Map();
    for (const crash of crashes) {
      const [x, y] = toScreen(crash.latitude_deg, crash.longitude_deg);
      if (x < -NEAR_PX || y < -NEAR_PX || x > width + NEAR_PX || y > height + NEAR_PX) continue;
      const [column, row] = [Math.floor(x / NEAR_PX), Math.floor(y / NEAR_PX)];
      let home = null;
      for (let i = column - 1; i <= column + 1 && !home; i++)
        for (let j = row - 1; j <= row + 1 && !home; j++)
          home = (cells.get(`${i},${j}`) || []).find((group) => Math.hypot(group.x - x, group.y - y) < NEAR_PX);
      if (home) { home.crashes.push(crash); continue; }
      const group = { x, y, crashes: [crash] };
      found.push(group);
      const cell = `${column},${row}`;
      cells.set(cell, [...(cells.get(cell) || []), group]);
    }
    for (const group of found) {
      const places = group.crashes.map((crash) => toScreen(crash.latitude_deg, crash.longitude_deg));
      group.x = places.reduce((sum, place) => sum + place[0], 0) / places.length;
      group.y = places.reduce((sum, place) => sum + place[1], 0) / places.length;
    }
    const overlap = (one, other) => one !== other && Math.hypot(one.x - other.x, one.y - other.y) < radiusOf(one) + radiusOf(other);
    for (let one; (one = found.find((each) => found.some((other) => overlap(each, other))));) {
      const other = found.find((each) => overlap(one, each));
      const share = other.crashes.length / (one.crashes.length + other.crashes.length);
      one.x += share * (other.x - one.x);
      one.y += share * (other.y - one.y);
      one.crashes = one.crashes.concat(other.crashes);
      found.splice(found.indexOf(other), 1);
    }
    return found;
  }

  const SHAPES = {
    verified: "M-6 0a6 6 0 1 0 12 0a6 6 0 1 0 -12 0z", first_event_only: "M0-7l7 7-7 7-7-7z", rejected: "M-5-5h10v10h-10z",
    failed: "M-6-4l2-2 4 4 4-4 2 2-4 4 4 4-2 2-4-4-4 4-2-2 4-4z", pending: "M0-7l7 7-7 7-7-7z",
  };

  let named = new Set();
  function drawOne(group) {
    const [crash] = group.crashes;
    const link = make("a", { href: `crashes/${crash.key}.html`, class: crash.final_state }, svg);
    const spot = make("path", { class: "spot", d: SHAPES[crash.final_state], transform: `translate(${group.x} ${group.y})` }, link);
    const label = `${crash.key}, ${crash.final_state}${crash.place ? `, ${crash.place}` : ""}`;
    link.setAttribute("aria-label", label);
    make("title", {}, spot).textContent = label;
  }

  function drawSeveral(group) {
    const number = group.crashes.length, radius = radiusOf(group) - 3;
    const counts = STATES.map((state) => [state, group.crashes.filter((crash) => crash.final_state === state).length]);
    const names = new Set(group.crashes.map((crash) => crash.state_name));
    const name = names.size === 1 ? [...names][0] : null;
    const said = counts.filter(([, n]) => n).map(([state, n]) => `${n} ${state}`).join(", ");
    const button = make("g", { class: "cluster", role: "button", tabindex: 0, transform: `translate(${group.x} ${group.y})` }, svg);
    make("title", {}, button).textContent = `${number} crashes${name ? ` in ${name}` : ""}: ${said}`;
    make("circle", { class: "disc", r: radius + 3 }, button);
    const length = 2 * Math.PI * radius;
    let begin = 0;
    for (const [state, n] of counts) {
      if (!n) continue;
      make("circle", { class: `ring ${state}`, r: radius, transform: "rotate(-90)",
        "stroke-dasharray": `${length * n / number} ${length}`, "stroke-dashoffset": -length * begin / number }, button);
      begin += n;
    }
    make("text", { "aria-hidden": true }, button).textContent = number;
    if (name && !named.has(name) && named.add(name)) make("text", { class: "name", y: radius + 14, "aria-hidden": true }, button).textContent = words(name);
    const open = () => {
      const [south, north] = range(group.crashes.map((crash) => crash.latitude_deg));
      const [west, east] = range(group.crashes.map((crash) => crash.longitude_deg));
      const before = view.scale;
      fit(group.crashes);
      if (Math.max(north - south, east - west) < LEAST_SPAN_DEG / 50 || view.scale < before * 1.01) pick(group.crashes);
      draw();
      moved();
    };
    button.addEventListener("click", open);
    button.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); open(); } });
  }

  function roundStep(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return [1, 2, 5, 10].find((factor) => factor * power >= value) * power;
  }

  function drawLand() {
    const [x, y] = toScreen(0, 0), across = shrink() * view.scale;
    land.setAttribute("transform", `matrix(${across} 0 0 ${-view.scale} ${x} ${y})`);
    svg.append(land);
  }

  function drawGraticule() {
    const { width, height } = size();
    const step = roundStep(Math.max(width / shrink(), height) / view.scale / 6);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const degrees = (value, signs) => `${Math.abs(value).toFixed(digits)}° ${value >= 0 ? signs[0] : signs[1]}`;
    const spanLat = height / view.scale / 2, spanLon = width / view.scale / shrink() / 2;
    for (let n = Math.ceil((view.lat - spanLat) / step); n * step <= view.lat + spanLat; n++) {
      const [, y] = toScreen(n * step, view.lon);
      make("line", { class: "graticule", x1: 0, x2: width, y1: y, y2: y }, svg);
      make("text", { x: 6, y: y - 4 }, svg).textContent = degrees(n * step, "NS");
    }
    for (let n = Math.ceil((view.lon - spanLon) / step); n * step <= view.lon + spanLon; n++) {
      const [x] = toScreen(view.lat, n * step);
      make("line", { class: "graticule", y1: 0, y2: height, x1: x, x2: x }, svg);
      if (x < width - 170) make("text", { x: x + 4, y: height - 6 }, svg).textContent = degrees(n * step, "EW");
    }
  }

  function drawScale() {
    const { width, height } = size();
    const metres = roundStep(60 * DEG_M / view.scale);
    const length = metres / DEG_M * view.scale;
    make("path", { d: `M${width - 14 - length} ${height - 16}v6h${length}v-6`, fill: "none", stroke: "currentColor", "stroke-width": 1.5 }, svg);
    make("text", { x: width - 14, y: height - 20, "text-anchor": "end" }, svg).textContent = metres < 1000 ? `${metres} m` : `${metres / 1000} km`;
  }

  function draw() {
    const focused = [...svg.querySelectorAll("[tabindex], a")].indexOf(document.activeElement);
    svg.replaceChildren();
    drawLand();
    drawGraticule();
    drawScale();
    named = new Set(); // the largest group of a state has its name
    for (const group of groups().sort((one, two) => two.crashes.length - one.crashes.length)) (group.crashes.length === 1 ? drawOne : drawSeveral)(group);
    if (focused >= 0) (svg.querySelectorAll("[tabindex], a")[0] || svg).focus();
  }

  const zoom = (factor) => { view.scale *= factor; draw(); moved(); };
  document.getElementById("nearer").addEventListener("click", () => zoom(2));
  document.getElementById("farther").addEventListener("click", () => zoom(0.5));
  document.getElementById("fit").addEventListener("click", () => { fit(crashes); draw(); moved(true); });
  const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  svg.addEventListener("keydown", (event) => {
    const step = STEPS[event.key], factor = { "+": 2, "=": 2, "-": 0.5 }[event.key];
    if (!step && !factor) return;
    event.preventDefault();
    if (factor) { zoom(factor); return; }
    const { width, height } = size();
    view.lon += step[0] * width / view.scale / shrink() / 8;
    view.lat += step[1] * height / view.scale / 8;
    draw();
    moved();
  });
  let grip = null;
  svg.addEventListener("pointerdown", (event) => { if (event.target === svg || event.target === land || event.target.classList.contains("graticule")) grip = [event.clientX, event.clientY]; });
  window.addEventListener("pointerup", () => { if (grip) moved(); grip = null; });
  window.addEventListener("pointermove", (event) => {
    if (!grip) return;
    view.lon -= (event.clientX - grip[0]) / view.scale / shrink();
    view.lat += (event.clientY - grip[1]) / view.scale;
    grip = [event.clientX, event.clientY];
    draw();
  });
  new ResizeObserver(() => draw()).observe(figure);

  return {
    // The middle (degrees) and the height (degrees of latitude) of what is seen, as in the address of the page.
    get seen() { return [view.lat.toFixed(5), view.lon.toFixed(5), (size().height / view.scale).toPrecision(4)].join(); },
    look(seen) {
      const [lat, lon, high] = seen.split(",").map(Number);
      if (!(high > 0) || !Number.isFinite(lat + lon)) return;
      view = { lat: Math.min(85, Math.max(-85, lat)), lon, scale: size().height / high };
      draw();
    },
    show(some, toFit) {
      crashes = some.filter((crash) => crash.latitude_deg != null && crash.longitude_deg != null);
      figure.hidden = false;
      if (toFit) fit(crashes);
      draw();
    },
  };
};
