// Bundles what the page uses of three.js into three.min.js; README.md says how to run it.
//
// A renderer of three.js imports every shader, headsets and environment maps. The page uses two
// kinds of material, so what only others need is replaced by empty modules, and the comments of the
// shaders are removed.

import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const UNUSED_SHADERS = new RegExp(
  "/(?:" + [
    "(?:ShaderLib/)(?:background|backgroundCube|cube|equirect|meshmatcap|meshnormal|meshphong|meshphysical|meshtoon|points|shadow|sprite|vsm|depth|distance|linedashed)",
    "(?:ShaderChunk/)(?:aomap|bumpmap|clearcoat|cube_uv|displacement|emissivemap|envmap_physical|gradientmap|iridescence|lightmap|lightprobes|lights_physical|lights_phong|lights_toon|metalnessmap|normalmap|roughnessmap|shadowmap|shadowmask|skinning|skinbase|skinnormal|tonemapping|transmission|morph|batching|dithering|bsdfs|fog|alphahash|map_particle|envmap)",
  ].join("|") + ")\\w*\\.glsl\\.js$");
// Module -> its replacement.
const REPLACED = [
  [/webxr\/WebXRManager\.js$/, `export class WebXRManager {
    constructor() { this.enabled = this.isPresenting = this.cameraAutoUpdate = false; }
    addEventListener() {} removeEventListener() {} setAnimationLoop() {} dispose() {}
    getDepthSensingMesh() { return null; } hasDepthSensing() { return false; }
    getEnvironmentBlendMode() {} updateCamera() {} getCamera() {} getFoveation() {}
  }`],
  [/PMREMGenerator\.js$/, "export class PMREMGenerator { dispose() {} }"],
  [/DFGLUTData\.js$/, "export function getDFGLUT() { return null; } export const DFGLUTData = null; export default null;"],
];

const plainer = {
  name: "plainer",
  setup(bundler) {
    bundler.onLoad({ filter: /three[\\/]src[\\/].*\.js$/ }, async ({ path }) => {
      const found = REPLACED.find(([name]) => name.test(path));
      if (found) return { contents: found[1] };
      const text = await readFile(path, "utf8");
      if (!path.endsWith(".glsl.js")) return { contents: text };
      if (UNUSED_SHADERS.test(path)) {
        const names = [...text.matchAll(/export (?:const|default)\s*(\w*)/g)];
        return { contents: names.map(([whole, name]) =>
          whole.startsWith("export const") ? `export const ${name} = "";` : 'export default "";').join("\n") };
      }
      return { contents: text.replace(/\/\*(?!\s*glsl\s*\*)[^]*?\*\//g, "").replace(/^\s*\/\/.*$/gm, "")
        .replace(/[ \t]+\/\/.*$/gm, "").replace(/^[ \t]+/gm, "").replace(/\n{2,}/g, "\n") };
    });
  },
};

await build({
  entryPoints: ["entry.js"],
  outfile: "three.min.js",
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2020",
  legalComments: "none",
  banner: { js: "/* three.js 0.187.0, https://threejs.org, MIT License, Copyright © 2010-2026 three.js authors */" },
  plugins: [plainer],
});
const text = await readFile("three.min.js", "utf8");
if (/<\/script|<!--/i.test(text)) throw new Error("the bundle would end its script");
await writeFile("three.min.js", text.trimEnd() + "\n");
