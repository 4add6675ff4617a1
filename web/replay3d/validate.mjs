// What the Khronos validator says of glTF files: `npm run validate -- FILE...`; fails on errors and warnings.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

let wrong = 0;
for (const name of process.argv.slice(2)) {
  const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(name)));
  wrong += issues.numErrors + issues.numWarnings;
  console.log(`${name}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} notes`);
  for (const each of issues.messages.filter((message) => message.severity < 2)) console.log(`  ${each.code} ${each.pointer}`);
}
process.exit(wrong ? 1 : 0);
