// How high roads and ground are at a place of the crash's frame, from the triangles of the glTF.
import { Triangle, Vector3 } from "three";

const CELL_M = 8; // three's rays try all triangles, too many for every body in every frame: here only those about a cell
const EDGE = -1e-3; // the share of a corner that counts as within: no gap between two triangles

// Returns (x, y, near) => { height, normal } of the surface whose height is nearest to `near`, or null where there is none.
export function groundOf(world) {
  const cells = new Map();
  let triangles = null; // made when the first height is asked for: not every crash has other courses
  function read() {
    triangles = [];
    world.traverse((each) => {
      if (!each.isMesh || each.parent?.name !== "roads_and_ground") return;
      const { index, attributes: { position } } = each.geometry;
      const corner = (k) => new Vector3().fromBufferAttribute(position, index.getX(k));
      for (let k = 0; k < index.count; k += 3) triangles.push(new Triangle(corner(k), corner(k + 1), corner(k + 2)));
    });
  }
  const reaches = (axis, from) => ({ a, b, c }) =>
    Math.max(a[axis], b[axis], c[axis]) >= from && Math.min(a[axis], b[axis], c[axis]) <= from + CELL_M;
  function about(i, j) {
    if (!triangles) read();
    const name = `${i} ${j}`;
    if (!cells.has(name)) cells.set(name, triangles.filter(reaches("x", i * CELL_M)).filter(reaches("y", j * CELL_M)));
    return cells.get(name);
  }
  return (x, y, near) => {
    let best = null;
    for (const triangle of about(Math.floor(x / CELL_M), Math.floor(y / CELL_M))) {
      const { a, b, c } = triangle, twice = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
      if (twice < 1e-9) continue; // upright, or the underside of a bridge
      const at_b = ((x - a.x) * (c.y - a.y) - (c.x - a.x) * (y - a.y)) / twice;
      const at_c = ((b.x - a.x) * (y - a.y) - (x - a.x) * (b.y - a.y)) / twice;
      if (Math.min(at_b, at_c, 1 - at_b - at_c) < EDGE) continue;
      const height = a.z + at_b * (b.z - a.z) + at_c * (c.z - a.z);
      if (!best || Math.abs(height - near) < Math.abs(best.height - near)) best = { height, triangle };
    }
    return best && { height: best.height, normal: best.triangle.getNormal(new Vector3()) };
  };
}
