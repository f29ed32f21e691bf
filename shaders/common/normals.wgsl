#define_import_path bevy_weathering::normals

// Relief on relief. Each function has a double-precision twin of the same name in `material::normals`, where the story is
// told. Slopes are falls per length, without unit; normals and axes are unit vectors. Pure: no bindings.
//
// Barre-Brisebois and Hill 2012, "Blending in Detail". Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU".

// Sine between the ways of the uvs along two sides of a pixel below which they are taken as one: less is rounding.
const LEAST_SINE: f32 = 1e-6;

// How uvs lie on a surface at a point.
struct Frame {
    // The direction in which u grows, and upright on it, to the side to which v grows.
    along_u: vec3<f32>,
    along_v: vec3<f32>,
    // Of the surface without relief.
    normal: vec3<f32>,
    // Way on the surface per unit of u, along `along_u`, metres; 0 where the uvs say nothing.
    per_u: f32,
    // The same per unit of v, along both.
    per_v: vec2<f32>,
}

// Slopes along u and v of a texel of the normal overlay. color: premultiplied, 128 of 255 is flat where it covers all.
fn painted_slopes(color: vec4<f32>) -> vec2<f32> {
    return (255.0 * color.rg - 128.0 * color.a) / 127.0;
}

// n of a relief that falls by s along two axes: (s, 1) / |(s, 1)|.
fn relief_normal(slopes: vec2<f32>) -> vec3<f32> {
    return normalize(vec3(slopes, 1.0));
}

// r = t (t . u) / t_z - u, with t = b + z and u = (-d_x, -d_y, d_z): the detail turned by the shortest arc from z to the
// base. base: b, detail: d; unit, in one frame whose third axis is z. b_z above -1; there, where no arc is the shortest, the
// detail is turned over.
fn reoriented(base: vec3<f32>, detail: vec3<f32>) -> vec3<f32> {
    let t = base + vec3(0.0, 0.0, 1.0);
    let u = detail * vec3(-1.0, -1.0, 1.0);
    return normalize(t * dot(t, u) / max(t.z, 1e-4) - u);
}

// A normal, or what is opposite to it, on the side on which another lies.
fn faced(normal: vec3<f32>, side: vec3<f32>) -> vec3<f32> {
    return select(-normal, normal, dot(normal, side) >= 0.0);
}

// The frame of a point, from how position (metres) and uv change over the screen. normal: of the surface without relief.
fn surface_frame(normal: vec3<f32>, dp_dx: vec3<f32>, dp_dy: vec3<f32>, duv_dx: vec2<f32>, duv_dy: vec2<f32>) -> Frame {
    let determinant = duv_dx.x * duv_dy.y - duv_dx.y * duv_dy.x;
    if abs(determinant) <= LEAST_SINE * length(duv_dx) * length(duv_dy) {
        return Frame(vec3(0.0), vec3(0.0), normal, 0.0, vec2(0.0));
    }
    let p_u = (dp_dx * duv_dy.y - dp_dy * duv_dx.y) / determinant;
    let p_v = (dp_dy * duv_dx.x - dp_dx * duv_dy.x) / determinant;
    let in_plane = p_u - normal * dot(normal, p_u);
    let area = length(cross(p_u, p_v));
    if dot(in_plane, in_plane) == 0.0 || area == 0.0 {
        return Frame(vec3(0.0), vec3(0.0), normal, 0.0, vec2(0.0));
    }
    let along_u = normalize(in_plane);
    let per_u = length(p_u);
    return Frame(
        along_u,
        faced(cross(normal, along_u), p_v),
        normal,
        per_u,
        vec2(dot(p_u, p_v), area) / per_u,
    );
}

// Slopes along the axes of a frame from falls per unit of u and of v, metres: s_u = f_u / p_u, s_v = (f_v - p_vu s_u) / p_vv.
fn slopes_in_frame(frame: Frame, falls: vec2<f32>) -> vec2<f32> {
    if frame.per_u == 0.0 {
        return vec2(0.0);
    }
    let along_u = falls.x / frame.per_u;
    return vec2(along_u, (falls.y - frame.per_v.x * along_u) / frame.per_v.y);
}

// A normal with a relief on it. base: the normal; slopes: of the relief along the axes of the frame.
fn relieved(frame: Frame, base: vec3<f32>, slopes: vec2<f32>) -> vec3<f32> {
    if frame.per_u == 0.0 {
        return base;
    }
    let in_frame = vec3(dot(base, frame.along_u), dot(base, frame.along_v), dot(base, frame.normal));
    let turned = reoriented(in_frame, relief_normal(slopes));
    return frame.along_u * turned.x + frame.along_v * turned.y + frame.normal * turned.z;
}
