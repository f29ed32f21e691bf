// Makes a level of the mip maps of a surface's colour maps from the level above it, where something was painted.
//
// One workgroup per touched tile of 16x16 texels of the level above, one invocation per texel of the level below. The mean is
// that of `mip_chain` in `src/overlay/mips.rs`, to the bit.

#import bevy_weathering::kernel::{bytes_from_color, color_from_bytes}

// The twin of `MipStep` in `src/overlay/gpu/mips.rs`.
struct MipStep {
    // Texels along each side of the level that is made.
    size: u32,
    // The step's first row in `tiles`.
    first_tile: u32,
    // The word in `lying` with which the level above begins.
    first_word: u32,
    // 1: `lying` says which texels count; 0: all do.
    masked: u32,
}

@group(0) @binding(0) var<uniform> made: MipStep;
// Columns of tiles, and rows above them; 16 bits each.
@group(0) @binding(1) var<storage, read> tiles: array<u32>;

@group(1) @binding(0) var diffuse_above: texture_2d<f32>;
@group(1) @binding(1) var specular_above: texture_2d<f32>;
@group(1) @binding(2) var normal_above: texture_2d<f32>;
@group(1) @binding(3) var diffuse_map: texture_storage_2d<rgba8unorm, write>;
@group(1) @binding(4) var specular_map: texture_storage_2d<rgba8unorm, write>;
@group(1) @binding(5) var normal_map: texture_storage_2d<rgba8unorm, write>;
// A bit a texel; a single word where all texels count.
@group(1) @binding(6) var<storage, read> lying: array<u32>;

// Whether a texel of the level above counts.
fn counts(texel: vec2<u32>) -> bool {
    if made.masked == 0u {
        return true;
    }
    let bit = texel.y * 2u * made.size + texel.x;
    return ((lying[made.first_word + bit / 32u] >> (bit % 32u)) & 1u) != 0u;
}

// The mean of what there is of four texels, rounded to the nearest. sum: of them; count: how many; 0 of none. A division by a
// number of 1 to 4 as a product, exact for what four bytes sum up to.
fn mean(sum: vec4<u32>, count: u32) -> vec4<u32> {
    let share = select(2048u >> (count >> 1u), 683u, count == 3u);
    return ((sum + vec4(count / 2u)) * share) >> vec4(11u);
}

@compute @workgroup_size(8, 8)
fn halve_maps(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let tile = tiles[made.first_tile + workgroup.x];
    let texel = vec2(tile & 0xffffu, tile >> 16u) * 8u + local.xy;
    if any(texel >= vec2(made.size)) {
        return;
    }
    var diffuse = vec4(0u);
    var specular = vec4(0u);
    var normal = vec4(0u);
    var count = 0u;
    for (var i = 0u; i < 4u; i += 1u) {
        let above = 2u * texel + vec2(i & 1u, i >> 1u);
        if counts(above) {
            diffuse += bytes_from_color(textureLoad(diffuse_above, above, 0));
            specular += bytes_from_color(textureLoad(specular_above, above, 0));
            normal += bytes_from_color(textureLoad(normal_above, above, 0));
            count += 1u;
        }
    }
    textureStore(diffuse_map, texel, color_from_bytes(mean(diffuse, count)));
    textureStore(specular_map, texel, color_from_bytes(mean(specular, count)));
    textureStore(normal_map, texel, color_from_bytes(mean(normal, count)));
}
