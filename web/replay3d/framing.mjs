// Where the camera stands so that what it films is seen: far enough for all of it, beside the contact, with the least in between.
import { Raycaster, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);
const RISE_RAD = 0.5; // above the horizon
const TURNS_RAD = [0.6, -0.6, 1.0, -1.0, 0]; // from square to the line between the two: aslant, one that is far takes less room
const LEAST_M = 9;
const FILLED = 0.8; // of the picture

// The direction to the camera from which two at `places` are beside each other, where the fewest bodies and things of the
// `world` stand between it and them. `away` is how far to look for such.
export function sideOf([one, other], world, away) {
  const line = other.clone().sub(one).setY(0);
  if (line.lengthSq() < 1e-4) line.set(1, 0, 0);
  const square = line.normalize().cross(UP);
  let best = null;
  for (const side of [1, -1]) for (const turn of TURNS_RAD) {
    const to = square.clone().multiplyScalar(side * Math.cos(RISE_RAD)).applyAxisAngle(UP, turn).setY(Math.sin(RISE_RAD));
    const hidden = [one, other].reduce((sum, at) => sum + between(at.clone().addScaledVector(to, away), at, world), 0);
    const cost = hidden + Math.abs(Math.abs(turn) - TURNS_RAD[0]);
    if (!best || cost < best.cost) best = { to, cost };
  }
  return best.to;
}

// How many surfaces stand between two places, up to the body that is at the second.
function between(from, to, world) {
  const line = to.clone().sub(from), far = line.length();
  const hits = new Raycaster(from, line.normalize(), 0, far - 3).intersectObject(world, true);
  return hits.filter((hit) => hit.object.visible && hit.object.material.opacity === 1).length;
}

// The place of a camera that looks from a direction at balls, each { at, radius } in m, and the middle of what it sees.
export function standing(balls, to, camera) {
  const right = UP.clone().cross(to).normalize(), up = to.clone().cross(right);
  const tall = FILLED * Math.tan(camera.fov * Math.PI / 360), wide = tall * camera.aspect;
  const middle = [right, up, to].reduce((sum, axis) => {
    const low = Math.min(...balls.map(({ at, radius }) => at.dot(axis) - radius));
    const high = Math.max(...balls.map(({ at, radius }) => at.dot(axis) + radius));
    return sum.addScaledVector(axis, (low + high) / 2);
  }, new Vector3());
  let away = LEAST_M;
  for (const { at, radius } of balls) {
    const from = at.clone().sub(middle), near = from.dot(to);
    const aside = Math.max((Math.abs(from.dot(right)) + radius) / wide, (Math.abs(from.dot(up)) + radius) / tall);
    away = Math.max(away, near + aside);
  }
  return { middle, eye: middle.clone().addScaledVector(to, away) };
}
