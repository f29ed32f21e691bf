// Stamps the plain way: a quad for each, blended into three maps.
//
// The dome of `shaders/common/kernel.wgsl` in floats. Where a texel lies on its stamp comes from the rasteriser, what
// lies under it from the blending unit: neither is worked out here.

struct Stamp {
    // Middle and half width, clip space; y up.
    @location(0) center: vec2<f32>,
    @location(1) radius: vec2<f32>,
    // Colour and opacity.
    @location(2) diffuse: vec4<f32>,
    // Reflectance, smoothness, unused, opacity.
    @location(3) specular: vec4<f32>,
    // Slope at the rim, -127..=127; opacity, 0..=255.
    @location(4) bump: vec2<f32>,
}

struct Corner {
    @builtin(position) position: vec4<f32>,
    // In radii, v down as on the map.
    @location(0) offset: vec2<f32>,
    @location(1) @interpolate(flat) diffuse: vec4<f32>,
    @location(2) @interpolate(flat) specular: vec4<f32>,
    @location(3) @interpolate(flat) bump: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) number: u32, stamp: Stamp) -> Corner {
    let side = vec2(select(-1.0, 1.0, (number & 1u) == 1u), select(-1.0, 1.0, number >= 2u));
    var out: Corner;
    out.position = vec4(stamp.center + side * stamp.radius, 0.0, 1.0);
    out.offset = vec2(side.x, -side.y);
    out.diffuse = stamp.diffuse;
    out.specular = stamp.specular;
    out.bump = stamp.bump;
    return out;
}

// What is laid over the maps, premultiplied.
struct Painted {
    @location(0) diffuse: vec4<f32>,
    @location(1) specular: vec4<f32>,
    @location(2) normal: vec4<f32>,
}

@fragment
fn fragment(in: Corner) -> Painted {
    let height = max(1.0 - dot(in.offset, in.offset), 0.0);
    let dome = height * height;
    let slopes = (128.0 + clamp(in.bump.x * in.offset, vec2(-127.0), vec2(127.0))) / 255.0;
    var out: Painted;
    out.diffuse = vec4(in.diffuse.rgb, 1.0) * (in.diffuse.a * dome);
    out.specular = vec4(in.specular.rgb, 1.0) * (in.specular.a * dome);
    out.normal = vec4(slopes, 1.0, 1.0) * (in.bump.y / 255.0 * dome);
    return out;
}
