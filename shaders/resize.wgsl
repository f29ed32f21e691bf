// Makes a colour map from one with half its side: each texel four times.
//
// One invocation per texel of the larger map. The same as `CpuMaps::resized` in `src/overlay/resample.rs`, to the bit.

@group(0) @binding(0) var smaller: texture_2d<f32>;
@group(0) @binding(1) var larger: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn double_map(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let texel = invocation.xy;
    if any(texel >= textureDimensions(larger)) {
        return;
    }
    textureStore(larger, texel, textureLoad(smaller, texel / 2u, 0));
}
