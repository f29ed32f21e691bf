//! Relief on relief: what normal a surface has that leans by its own normal map and carries something with a relief, too.
//!
//! What falls on a surface, what lies there and the waves of its water are kept as slopes along u and v. Added to a normal
//! they would be flattened where the surface leans: a drop on a steep grain would lose its own shape. Instead slopes become a
//! unit normal ([`relief_normal`]), and that is turned by the shortest arc that takes the smooth surface's normal to the
//! leaning one ([`reoriented`]): reoriented normal mapping, which keeps all of both. A flat relief changes nothing, and on a
//! flat surface the relief is what it is.
//!
//! **Frame.** Both normals have to be told in one frame ([`surface_frame`]): the smooth normal, the direction in which u grows,
//! and what stands upright on both, towards growing v. It comes from how position and uv change over the screen, so a mesh needs
//! no tangents, and mirrored and sheared uvs are right. Nor does it matter in which frame the base normal map was made: the arc
//! is the same in the world. The frame knows how long u and v are there, so what is kept as a height is as steep as it is in the
//! world, whatever the size of the map and however uvs are stretched ([`slopes_in_frame`]).
//!
//! **Convention.** Base normal maps are Bevy's: OpenGL's, green leans up the image, against v
//! (`StandardMaterial::flip_normal_map_y` for the others). Stamps and normal overlays hold slopes, and green leans towards
//! growing v, down the image, as DirectX has it: 128 is flat, and 127 more is a fall by 1 for every 1.
//!
//! **Back faces.** Where Bevy turns the normal of a double-sided surface to the viewer, the frame's turns with it ([`faced`]);
//! u and v stay. So what is raised is raised on the side that is seen.
//!
//! Each function has a twin of the same name in `shaders/common/normals.wgsl`.
//!
//! - Barre-Brisebois and Hill 2012, *Blending in Detail*.
//! - Mikkelsen 2010, *Bump mapping unparametrized surfaces on the GPU*.

use bevy::math::{DVec2, DVec3};

/// Sine between the ways of the uvs along two sides of a pixel below which they are taken as one: less is rounding.
const LEAST_SINE: f64 = 1e-6;

/// How uvs lie on a surface at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The direction in which u grows; unit.
    pub along_u: DVec3,
    /// Upright on that, to the side to which v grows; unit.
    pub along_v: DVec3,
    /// Of the surface without relief; unit.
    pub normal: DVec3,
    /// Way on the surface per unit of u, along `along_u`, metres; 0 where the uvs say nothing.
    pub per_u: f64,
    /// The same per unit of v, along `along_u` and `along_v`.
    pub per_v: DVec2,
}

/// Slopes along u and v of a texel of the normal overlay. `color`: red, green and coverage, 0..=1, premultiplied; 128 of 255 is
/// flat where it covers all.
pub fn painted_slopes(color: [f64; 3]) -> DVec2 {
    let [red, green, coverage] = color;
    (255.0 * DVec2::new(red, green) - 128.0 * coverage) / 127.0
}

/// n of a relief that falls by s along two axes: `(s, 1) / |(s, 1)|`.
pub fn relief_normal(slopes: DVec2) -> DVec3 {
    slopes.extend(1.0).normalize()
}

/// `r = t (t . u) / t_z - u`, with `t = b + z` and `u = (-d_x, -d_y, d_z)`: the detail turned by the shortest arc from z to the
/// base. `base`: b, `detail`: d; unit, in one frame whose third axis is z. `b_z` above -1; there, where no arc is the shortest,
/// the detail is turned over.
pub fn reoriented(base: DVec3, detail: DVec3) -> DVec3 {
    let t = base + DVec3::Z;
    let u = detail * DVec3::new(-1.0, -1.0, 1.0);
    (t * t.dot(u) / t.z.max(1e-4) - u).normalize()
}

/// A normal, or what is opposite to it, on the side on which `side` lies.
pub fn faced(normal: DVec3, side: DVec3) -> DVec3 {
    if normal.dot(side) >= 0.0 { normal } else { -normal }
}

/// The frame of a point, from how position (metres) and uv change over the screen. `normal`: of the surface without relief,
/// unit.
pub fn surface_frame(normal: DVec3, dp_dx: DVec3, dp_dy: DVec3, duv_dx: DVec2, duv_dy: DVec2) -> Frame {
    let nothing =
        Frame { along_u: DVec3::ZERO, along_v: DVec3::ZERO, normal, per_u: 0.0, per_v: DVec2::ZERO };
    let determinant = duv_dx.perp_dot(duv_dy);
    if determinant.abs() <= LEAST_SINE * duv_dx.length() * duv_dy.length() {
        return nothing;
    }
    let p_u = (dp_dx * duv_dy.y - dp_dy * duv_dx.y) / determinant;
    let p_v = (dp_dy * duv_dx.x - dp_dx * duv_dy.x) / determinant;
    let in_plane = p_u - normal * normal.dot(p_u);
    let area = p_u.cross(p_v).length();
    if in_plane == DVec3::ZERO || area == 0.0 {
        return nothing;
    }
    let along_u = in_plane.normalize();
    let per_u = p_u.length();
    let along_v = faced(normal.cross(along_u), p_v);
    Frame { along_u, along_v, normal, per_u, per_v: DVec2::new(p_u.dot(p_v), area) / per_u }
}

/// Slopes along the axes of a frame from falls per unit of u and of v, metres: `s_u = f_u / p_u`,
/// `s_v = (f_v - p_vu s_u) / p_vv`.
pub fn slopes_in_frame(frame: Frame, falls: DVec2) -> DVec2 {
    if frame.per_u == 0.0 {
        return DVec2::ZERO;
    }
    let along_u = falls.x / frame.per_u;
    DVec2::new(along_u, (falls.y - frame.per_v.x * along_u) / frame.per_v.y)
}

/// A normal with a relief on it. `base`: the normal, unit; `slopes`: of the relief along the axes of the frame.
pub fn relieved(frame: Frame, base: DVec3, slopes: DVec2) -> DVec3 {
    if frame.per_u == 0.0 {
        return base;
    }
    let in_frame = DVec3::new(base.dot(frame.along_u), base.dot(frame.along_v), base.dot(frame.normal));
    let turned = reoriented(in_frame, relief_normal(slopes));
    frame.along_u * turned.x + frame.along_v * turned.y + frame.normal * turned.z
}

#[cfg(test)]
mod tests {
    use bevy::math::DQuat;

    use super::*;
    use crate::material::film::ripples::pcg;
    use crate::overlay::kernel::{blend_over, slope_color};

    /// Slopes in [-3, 3).
    fn random_slopes() -> impl Iterator<Item = DVec2> {
        let random = |seed: u32| f64::from(pcg(seed)) / f64::from(u32::MAX) * 6.0 - 3.0;
        (0..1000).map(move |number| DVec2::new(random(2 * number), random(2 * number + 1)))
    }

    fn close(a: DVec3, b: DVec3) -> bool {
        (a - b).length() < 1e-9
    }

    #[test]
    fn a_relief_is_turned_by_the_shortest_arc() {
        let normals: Vec<DVec3> = random_slopes().map(relief_normal).collect();
        for (&base, &detail) in normals.iter().zip(normals.iter().rev()) {
            let got = reoriented(base, detail);
            let expected = DQuat::from_rotation_arc(DVec3::Z, base) * detail;
            assert!(close(got, expected), "{base} {detail}: {got} instead of {expected}");
            assert!((got.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_flat_changes_nothing() {
        for normal in random_slopes().map(relief_normal) {
            assert!(close(reoriented(normal, DVec3::Z), normal));
            assert!(close(reoriented(DVec3::Z, normal), normal));
        }
    }

    #[test]
    fn a_base_that_looks_away_gives_a_unit_normal_still() {
        for base in [DVec3::NEG_Z, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
            let got = reoriented(base, relief_normal(DVec2::new(0.5, -1.0)));
            assert!((got.length() - 1.0).abs() < 1e-9, "{base}: {got}");
        }
    }

    #[test]
    fn painted_slopes_are_those_that_were_painted() {
        for (bump, offset) in [(127, 256), (-127, 256), (60, -100), (0, 77)] {
            let color = slope_color(bump, offset);
            let slope = f64::from(bump * offset / 256) / 127.0;
            let byte = |value: u32| f64::from(value) / 255.0;
            let full = painted_slopes([byte(color), byte(128), 1.0]);
            assert!((full - DVec2::new(slope, 0.0)).length() < 1e-12, "{full}");
            // Half of it covers: half as steep, to the rounding of a byte.
            let half = painted_slopes([byte(blend_over(color, 128, 0)), byte(0), byte(128)]);
            assert!((half.x - slope * 128.0 / 255.0).abs() < 0.01, "{half}");
        }
        assert_eq!(painted_slopes([0.0; 3]), DVec2::ZERO);
    }

    #[test]
    fn heights_are_as_steep_as_they_are_in_the_world() {
        // A plane z = a x + b y over uvs that are stretched, sheared, mirrored.
        let (a, b) = (0.3, -0.7);
        for (p_u, p_v) in [
            (DVec3::X, DVec3::Y),
            (DVec3::new(2.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0)),
            (DVec3::new(0.5, -1.0, 0.0), DVec3::new(-4.0, 0.2, 0.0)),
        ] {
            // The screen looks at it askew.
            let (duv_dx, duv_dy) = (DVec2::new(0.01, 0.002), DVec2::new(-0.003, 0.02));
            let across = |duv: DVec2| p_u * duv.x + p_v * duv.y;
            let frame = surface_frame(DVec3::Z, across(duv_dx), across(duv_dy), duv_dx, duv_dy);
            let falls = -DVec2::new(a * p_u.x + b * p_u.y, a * p_v.x + b * p_v.y);
            let got = relieved(frame, DVec3::Z, slopes_in_frame(frame, falls));
            let expected = DVec3::new(-a, -b, 1.0).normalize();
            assert!(close(got, expected), "{p_u} {p_v}: {got} instead of {expected}");
            assert!(frame.along_u.dot(p_u) > 0.0 && frame.along_v.dot(p_v) > 0.0);
        }
    }

    #[test]
    fn uvs_that_say_nothing_leave_the_normal_alone() {
        let base = relief_normal(DVec2::new(0.2, 0.1));
        // One line, as nearly one as rounding leaves it, and no way at all.
        let nearly = DVec2::new(1.0, 1e-8);
        for (dp_dy, duv_dy) in
            [(DVec3::Y, DVec2::X), (DVec3::X, DVec2::Y), (DVec3::Y, nearly), (DVec3::Y, DVec2::ZERO)]
        {
            let frame = surface_frame(DVec3::Z, DVec3::X, dp_dy, DVec2::X, duv_dy);
            assert_eq!(relieved(frame, base, DVec2::ONE), base);
            assert_eq!(slopes_in_frame(frame, DVec2::ONE), DVec2::ZERO);
        }
    }

    #[test]
    fn what_is_raised_is_raised_on_the_side_that_is_seen() {
        let frame = |normal| surface_frame(normal, DVec3::X, DVec3::Y, DVec2::X, DVec2::Y);
        let slopes = DVec2::new(0.4, -0.2);
        let seen = DVec3::new(0.1, 0.2, -1.0).normalize();
        let back = frame(faced(DVec3::Z, seen));
        assert_eq!(back.normal, DVec3::NEG_Z);
        // The same lean along u and v, seen from either side.
        let (front, behind) =
            (relieved(frame(DVec3::Z), DVec3::Z, slopes), relieved(back, DVec3::NEG_Z, slopes));
        assert!(close(front * DVec3::new(1.0, 1.0, -1.0), behind), "{front} {behind}");
    }
}
