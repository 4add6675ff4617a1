// Other likely courses: copies of the bodies, as they are before the contact, along ways of which the page says where they
// are. Their heights and slopes are those of the ground, their postures those of the best estimate at the same moment.
import { Quaternion, Vector3 } from "three";
import { groundOf } from "./ground.mjs";

const FAINT = 0.3;
const UP = new Vector3(0, 0, 1);
const STEP_S = 0.1, KERB_M = 0.3, SLOPE = 0.5; // from step to step a body gets over a kerb and along such a slope, not more

// `courses` have `at(number, t)`, a pose {x, y, h} or null before the time that the course `starts`, and `contact`, {x, y};
// `logged(number, t)` is the pose of the best estimate. `bodies` and `contacts` are the view's, `pose(t)` moves its bodies.
export function otherCourses(world, bodies, contacts, courses, logged, pose) {
  const groundAt = groundOf(world), faints = new Map();
  if (courses.length) pose(courses[0].starts); // all start when the first does, near the best estimate
  const copies = courses.flatMap((course) => [...bodies.values()].map((body) => {
    const node = body.node.clone();
    node.visible = false;
    body.node.parent.add(node);
    const copied = below(node);
    const half = body.kind === "person" ? 0 : -node.children[0].position.z; // of its height: the shell stands on the road
    const near = body.middle.position.z - half;
    return { course, body, node, half, parts: below(body.node).map((part, k) => [part, copied[k]]), wanted: false, there: false,
      height: heightAlong((t) => course.at(body.number, t), course.starts, near),
      logged_height: heightAlong((t) => logged(body.number, t), course.starts, near) };
  }));
  const marks = courses.map((course) => {
    const [first] = contacts, { x, y } = course.contact, at = first.node.position, node = first.node.clone();
    first.node.parent.add(node);
    const [from, to] = [at, { x, y }].map((where) => groundAt(where.x, where.y, at.z));
    const rise = from && to ? to.height - from.height : 0;
    node.position.set(x, y, at.z + (Math.abs(rise) < SLOPE * Math.hypot(x - at.x, y - at.y) ? rise : 0));
    return { ...first, node, course };
  });
  let chosen = null;

  // The height of the ground along a way, by time. Where it breaks off, as beside a bridge, it goes on as high as it was: the
  // simulation's ground does so too.
  function heightAlong(at, starts, near) {
    const heights = [];
    function next() {
      const t = starts + 1e-6 + heights.length * STEP_S, last = heights.at(-1) ?? near, to = at(t);
      if (!to) return last; // of a course without this body
      const from = at(t - STEP_S), found = groundAt(to.x, to.y, last)?.height ?? last;
      const most = heights.length && from ? KERB_M + SLOPE * Math.hypot(to.x - from.x, to.y - from.y) : Infinity;
      return Math.abs(found - last) <= most ? found : last;
    }
    return (t) => {
      const steps = Math.max(0, t - starts) / STEP_S, k = Math.floor(steps);
      while (heights.length < k + 2) heights.push(next());
      return heights[k] + (steps - k) * (heights[k + 1] - heights[k]);
    };
  }
  function place({ course, body, node, half, parts, height, logged_height }, t) {
    const to = course.at(body.number, t);
    if (!to) return false;
    for (const [part, copy] of parts) { copy.position.copy(part.position); copy.quaternion.copy(part.quaternion); }
    if (body.kind === "person") { // parts are in the crash's frame: all of them are moved by as much
      const from = logged(body.number, t);
      node.quaternion.setFromAxisAngle(UP, to.h - from.h);
      node.position.set(-from.x, -from.y, -logged_height(t)).applyQuaternion(node.quaternion);
      node.position.add(new Vector3(to.x, to.y, height(t)));
    } else {
      const z = height(t), ground = groundAt(to.x, to.y, z);
      const along = ground && Math.abs(ground.height - z) < KERB_M ? ground.normal : UP;
      node.position.set(to.x, to.y, z + half);
      node.quaternion.setFromUnitVectors(UP, along).multiply(new Quaternion().setFromAxisAngle(UP, to.h));
    }
    return true;
  }
  function faintOf(material) {
    if (!faints.has(material)) faints.set(material, Object.assign(material.clone(), {
      solid: material, opacity: FAINT * material.opacity, transparent: true,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4, // behind what is shown in full at the same place
    }));
    return faints.get(material);
  }
  function draw(node, faint) {
    node.traverse((each) => {
      if (!each.isMesh) return;
      const solid = each.material.solid ?? each.material;
      each.material = faint ? faintOf(solid) : solid;
      each.castShadow = !faint && solid.opacity === 1;
    });
  }
  const shownOf = (body) => copies.find((copy) => copy.body === body && copy.course === chosen && copy.there)?.node ?? body.node;
  return {
    show(t) {
      for (const copy of copies) copy.there = copy.wanted && place(copy, t);
    },
    // Who looks from `within` a body, a number or null, sees no other course of it.
    see(within) {
      for (const { body, node, there } of copies) node.visible = there && (node === shownOf(body) || body.number !== within);
      for (const body of bodies.values()) body.node.visible = body.node === shownOf(body) || body.number !== within;
    },
    // `course` is shown in full, null for the best estimate, which is faint beside another; so are all others if `faint`.
    choose(course, faint) {
      chosen = course;
      for (const body of bodies.values()) draw(body.node, chosen !== null);
      for (const copy of copies) {
        copy.wanted = copy.course === chosen || faint;
        draw(copy.node, copy.course !== chosen);
      }
    },
    shownOf,
    marks,
    isShown: (mark) => (mark.course ?? null) === chosen,
  };
}

function below(node) {
  const all = [];
  node.traverse((each) => { if (each !== node) all.push(each); });
  return all;
}
