#!/bin/sh
# Makes the two vendored libraries anew; needs node, which no user of armwright does: sh rebuild.sh
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
cp "$here/three-entry.js" "$work"
cd "$work"
npm install --silent --no-fund --no-audit --no-save plotly.js-basic-dist-min@4.1.1 three@0.187.0 esbuild@0.28.2
npx esbuild three-entry.js --bundle --minify --format=iife --global-name=THREE --outfile="$here/three.min.js" --legal-comments=inline
cp node_modules/plotly.js-basic-dist-min/plotly-basic.min.js "$here"
cp node_modules/plotly.js-basic-dist-min/LICENSE "$here/plotly.LICENSE"
cp node_modules/three/LICENSE "$here/three.LICENSE"
rm -rf "$work"
