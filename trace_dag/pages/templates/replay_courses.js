// Other likely courses of the crash: one that is chosen, before the best estimate, or all of them, faint, behind it. Each has
// steps from its contact, which is at the same moment as that of the best estimate; nothing is shown of it before its first.
const chosen_course = () => courses[shown_course() - 1];
const shown_course = () => Number($("course").value) || 0; // 0 is the best estimate
const summed = row => { let sum = 0; return row.map(by => sum += by); };
const courses = hit === null ? [] : D.courses.map((course, k) => {
  const group = make($("courses"), "g", {}), lines = make(graph, "g", {});
  const bodies = new Map();
  for (const { number, ...rows } of course.bodies) {
    const v = D.vehicles.find(v => v.number === number);
    if (!v) continue;
    const [x, y, h] = ["x", "y", "h"].map(name => summed(rows[name]).map(each => each * course.units[name]));
    const speed = x.map((_, i) => { const a = Math.max(i - 1, 0), b = Math.min(i + 1, x.length - 1); return Math.hypot(x[b] - x[a], y[b] - y[a]) / ((b - a || 1) * course.step); });
    make(group, "polyline", { points: x.map((m, i) => m + "," + -y[i]).join(" "), fill: "none", stroke: v.colour, "stroke-width": 1.5, "stroke-dasharray": "1 5", "stroke-linecap": "round", "vector-effect": "non-scaling-stroke" });
    const body = make(group, "g", {});
    if (v.lines) make(body, "circle", { r: .35, fill: v.colour, stroke: "#fff", "stroke-width": .08 });
    else {
      make(body, "rect", { x: -v.length / 2, y: -v.width / 2, width: v.length, height: v.width, rx: Math.min(.35, v.width / 3), fill: v.colour, stroke: "#fff", "stroke-width": .12 });
      make(body, "rect", { x: .08 * v.length, y: -.4 * v.width, width: .14 * v.length, height: .8 * v.width, rx: .1, fill: "#fff", opacity: .85 });
    }
    make(body, "title", {}, `${v.name} in ${course.name}`);
    if (!is_trailer(v)) make(lines, "polyline", { fill: "none", stroke: v.colour, "stroke-width": 2, "stroke-dasharray": "6 3", "vector-effect": "non-scaling-stroke",
      points: speed.map((s, i) => 1000 * (hit + course.begins + i * course.step) / (end || 1) + "," + (98 - 94 * Math.min(s, top_v) / top_v)).join(" ") });
    bodies.set(number, { x, y, h, speed, body });
  }
  const star = make($("contact"), "g", { class: "marker" });
  star.at = { time: hit, ...course.contact };
  star.course = k + 1;
  make(star, "circle", { r: .6, fill: D.contact_colour, stroke: "#fff", "stroke-width": .1 });
  make(star, "title", {}, `First contact in ${course.name}`);
  // Where a body is at a moment: x, y, heading and speed; null before its first step.
  function at(number, now) {
    const of = bodies.get(number), step = (now - hit - course.begins) / course.step;
    if (!of || step < 0) return null;
    const i = Math.min(Math.floor(step), of.x.length - 1), j = Math.min(i + 1, of.x.length - 1), share = Math.min(step - i, 1);
    return Object.fromEntries(["x", "y", "h", "speed"].map(name => [name, of[name][i] + share * (of[name][j] - of[name][i])]));
  }
  function show(now) {
    group.setAttribute("visibility", now < hit + course.begins ? "hidden" : "visible");
    for (const [number, { body }] of bodies) {
      const here = at(number, now);
      if (here) body.setAttribute("transform", `translate(${here.x} ${-here.y}) rotate(${-here.h * 180 / Math.PI})`);
    }
  }
  return { ...course, starts: hit + course.begins, group, lines, at, show };
});
function choose_course(asked) {
  const select = $("course");
  if ([...select.options].some(option => option.value === asked)) select.value = asked;
  const chosen = chosen_course(), faint = select.value === "all";
  for (const course of courses) {
    course.group.setAttribute("opacity", course === chosen ? 1 : faint ? .3 : 0);
    course.lines.setAttribute("opacity", course === chosen ? 1 : 0);
  }
  for (const id of ["bodies", "paths", "rings", "speeds"]) $(id).setAttribute("opacity", chosen ? .3 : 1);
  if (chosen) $("courses").append(chosen.group); // above the others
  $("course-said").textContent = chosen ? "Faint: the best estimate." : faint ? `Faint: other likely courses, from ${-courses[0].begins} s before the impact.` : "";
  {% if in_3d %}
  solid?.choose(chosen ?? null, faint);
  {% endif %}
}
if (courses.length) {
  $("likely").hidden = false;
  $("course").add(new Option("Best estimate", "best"));
  courses.forEach((course, k) => $("course").add(new Option(course.name[0].toUpperCase() + course.name.slice(1), String(k + 1))));
  $("course").add(new Option("Best estimate, the others faint", "all"));
  $("course").addEventListener("change", () => {
    choose_course();
    line.show(line.now);
  });
}
