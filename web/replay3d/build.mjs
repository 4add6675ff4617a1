// Builds the 3D view of replays: what of three.js it uses and view.mjs, minified, as one classic script, which pages
// opened from a file can load too. `npm ci && npm run build`; the result is kept, so that nobody else needs npm.
import { build } from "esbuild";
import { readFileSync } from "node:fs";

const three = new URL("node_modules/three/", import.meta.url);
const { version } = JSON.parse(readFileSync(new URL("package.json", three), "utf8"));
const licence = readFileSync(new URL("LICENSE", three), "utf8").trim();

await build({
  entryPoints: ["view.mjs"],
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "replay3d",
  target: ["es2022"],
  legalComments: "none",
  banner: { js: `/*! The 3D view of trace-dag's replays (Apache-2.0), with three.js ${version}:\n\n${licence}\n*/` },
  outfile: "../../trace_dag/pages/templates/replay3d.js",
});
