// What stands between the camera and a party fades: decks of bridges, walls, trees, the ground above a tunnel.
import { Vector4 } from "three";

const MOST = 6; // parties that are looked for
const LEFT = "0.1"; // of what is faded, so that it is still seen to be there

// `place` is the part of the world that may fade. Returns see(targets, on), each { at, radius } in m: kept in sight while `on`.
export function cutaway(place) {
  const targets = { value: Array.from({ length: MOST }, () => new Vector4(0, 0, 0, 0)) }; // radius 0: none
  for (const material of materialsOf(place)) material.onBeforeCompile = (shader) => {
    shader.uniforms.targets = targets;
    shader.vertexShader = shader.vertexShader
      .replace("void main() {", "varying vec3 inWorld;\nvoid main() {")
      .replace("#include <project_vertex>", "#include <project_vertex>\ninWorld = (modelMatrix * vec4(transformed, 1.0)).xyz;");
    // Within the cone from the camera to a party, nearer than the party and above its wheels: one pixel of ten is left.
    shader.fragmentShader = shader.fragmentShader
      .replace("void main() {", `varying vec3 inWorld;
        uniform vec4 targets[${MOST}];
        float hides(vec4 target) {
          vec3 line = target.xyz - cameraPosition, to = inWorld - cameraPosition;
          float far = length(line), along = dot(to, line) / far, share = along / far;
          float off = length(to - line * share) / max(target.w * share, 0.01);
          float before = smoothstep(0.3, 0.8, far - along - 0.5 * target.w);
          return target.w > 0.0 && inWorld.y > target.y ? before * (1.0 - smoothstep(0.8, 1.2, off)) : 0.0;
        }
        void main() {`)
      .replace("#include <clipping_planes_fragment>", `#include <clipping_planes_fragment>
        float hidden = 0.0;
        for (int k = 0; k < ${MOST}; k++) hidden = max(hidden, hides(targets[k]));
        float grain = fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))));
        if (hidden * (1.0 - ${LEFT}) > grain) discard;`);
  };
  return (seen, on) => targets.value.forEach((target, k) => {
    if (on && k < seen.length) target.set(...seen[k].at.toArray(), seen[k].radius);
    else target.w = 0;
  });
}

function materialsOf(place) {
  const found = new Set();
  place?.traverse((each) => { if (each.isMesh) found.add(each.material); });
  return found;
}
