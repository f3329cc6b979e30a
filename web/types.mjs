// Makes api-types.ts for each page. The files contain the types of the objects in the description of the page's API.
// With --check the program only compares the files.
import { readFileSync, writeFileSync } from 'node:fs';

import openapiTS, { astToString } from 'openapi-typescript';

for (const [description, page] of [['openapi', 'arm'], ['ucom-openapi', 'chain']]) {
  const { openapi, info, components } = JSON.parse(readFileSync(new URL(`../docs/${description}.json`, import.meta.url), 'utf8'));
  const objects = { openapi, info, paths: {}, components: { schemas: components.schemas } };
  const types = await openapiTS(objects, { rootTypes: true, rootTypesNoSchemaPrefix: true });
  const text = `// Made of docs/${description}.json by npm run types.\n${astToString(types)}`;
  const file = new URL(`src/lib/${page}/api-types.ts`, import.meta.url);
  if (!process.argv.includes('--check')) writeFileSync(file, text);
  else if (readFileSync(file, 'utf8') !== text) throw new Error(`src/lib/${page}/api-types.ts is not that of docs/${description}.json: npm run types`);
}
