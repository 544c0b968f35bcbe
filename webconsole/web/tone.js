// The tone curve of the endoscope's pictures, as Filament has it: a fit of the curve of film (Narkowicz 2016).

import * as THREE from "./vendor/three.module.js"

const OWN = "vec3 CustomToneMapping( vec3 color ) { return color; }"

THREE.ShaderChunk.tonemapping_pars_fragment = THREE.ShaderChunk.tonemapping_pars_fragment.replace(OWN, `
vec3 CustomToneMapping( vec3 color ) {
  color *= toneMappingExposure;
  return clamp( color * ( 2.51 * color + 0.03 ) / ( color * ( 2.43 * color + 0.59 ) + 0.14 ), 0.0, 1.0 );
}`)

export const FILMIC = THREE.CustomToneMapping
