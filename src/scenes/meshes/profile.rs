//! What a lathe turns: a spline through a table of control points, cut into rings where it bends.
//!
//! The spline is the centripetal Catmull-Rom one, which has neither loops nor cusps. At a control point it
//! runs in the direction halfway between the two chords that meet there. Points in a line therefore give a
//! straight wall, and a corner is made of two points close to each other, with one more on the line before
//! and after them to keep the bend from spreading along the wall.
//!
//! Catmull and Rom, "A class of local interpolating splines", 1974; the centripetal knots after Yuksel,
//! Schaefer and Keyser, "Parameterization and applications of Catmull-Rom curves", 2011.

use bevy::math::Vec2;

/// The outline of a vessel.
pub(super) struct Profile {
    /// Radius and height for a vessel about one unit tall, in the order in which a hand would follow the
    /// surface from the inside over the lip to the underside.
    pub(super) control: &'static [[f32; 2]],
    /// In 1/heights. Added to the curvature, so that straight pieces do not go without rings: the smaller
    /// it is, the more of the rings go into the bends.
    pub(super) least_curvature: f32,
    /// With fewer rings the shape is lost.
    pub(super) least_rings: u32,
}

/// A point of the profile: radius and height, the unit tangent in the direction of the walk, and the arc
/// length walked so far as a fraction of the whole.
#[derive(Clone, Copy)]
pub(super) struct ProfilePoint {
    pub(super) at: Vec2,
    pub(super) tangent: Vec2,
    pub(super) arc: f32,
}

impl Profile {
    /// `rings + 1` points along the spline, closer to each other where it turns. Its own extremes of height
    /// are scaled to 0 and 1.
    pub(super) fn points(&self, rings: u32) -> Vec<ProfilePoint> {
        let fine = self.polyline();
        let (low, high) = fine
            .iter()
            .fold((f32::MAX, f32::MIN), |(low, high), point| (low.min(point.at.y), high.max(point.at.y)));
        let stretch = 1.0 / (high - low);
        // A chord stays equally close to its arc everywhere if rings are dense as the root of the curvature.
        let mut walked = vec![(0.0, 0.0)];
        let (mut length, mut rings_due) = (0.0f32, 0.0f32);
        for pair in fine.windows(2) {
            let step = pair[0].at.distance(pair[1].at);
            let turn = pair[0].tangent.angle_to(pair[1].tangent).abs();
            length += step;
            rings_due += ((self.least_curvature * step + turn) * step).sqrt();
            walked.push((rings_due, length));
        }
        (0..=rings)
            .map(|ring| {
                let wanted = rings_due * ring as f32 / rings as f32;
                let i = walked.partition_point(|&(due, _)| due < wanted).clamp(1, fine.len() - 1);
                let ((due_before, length_before), (due_after, length_after)) = (walked[i - 1], walked[i]);
                let t = ((wanted - due_before) / (due_after - due_before)).clamp(0.0, 1.0);
                let at = fine[i - 1].at.lerp(fine[i].at, t);
                let along = fine[i - 1].tangent.lerp(fine[i].tangent, t);
                ProfilePoint {
                    at: Vec2::new(at.x, (at.y - low) * stretch),
                    tangent: Vec2::new(along.x, along.y * stretch).normalize(),
                    arc: ((length_before + (length_after - length_before) * t) / length).clamp(0.0, 1.0),
                }
            })
            .collect()
    }

    /// The spline as a fine polyline of cubic Hermite spans; neither arcs nor unit tangents yet.
    fn polyline(&self) -> Vec<ProfilePoint> {
        // Fine enough that a chord stands for its arc: a few hundredths of a percent of the height each.
        const STEPS_PER_SPAN: usize = 64;
        let control: Vec<Vec2> = self.control.iter().map(|&point| point.into()).collect();
        let spans = control.len() - 1;
        let knot: Vec<f32> = control.windows(2).map(|pair| pair[0].distance(pair[1]).sqrt()).collect();
        let slope: Vec<Vec2> = (0..spans).map(|i| (control[i + 1] - control[i]) / knot[i]).collect();
        let tangent = |i: usize| match i {
            0 => slope[0],
            i if i == spans => slope[spans - 1],
            i => (slope[i - 1] * knot[i] + slope[i] * knot[i - 1]) / (knot[i - 1] + knot[i]),
        };
        (0..=spans * STEPS_PER_SPAN)
            .map(|step| {
                let span = (step / STEPS_PER_SPAN).min(spans - 1);
                let t = (step - span * STEPS_PER_SPAN) as f32 / STEPS_PER_SPAN as f32;
                let (p0, p1) = (control[span], control[span + 1]);
                let (m0, m1) = (tangent(span) * knot[span], tangent(span + 1) * knot[span]);
                let at = p0 * ((2.0 * t - 3.0) * t * t + 1.0)
                    + p1 * ((3.0 - 2.0 * t) * t * t)
                    + m0 * (((t - 2.0) * t + 1.0) * t)
                    + m1 * ((t - 1.0) * t * t);
                let along = (p1 - p0) * (6.0 * t * (1.0 - t))
                    + m0 * ((3.0 * t - 4.0) * t + 1.0)
                    + m1 * ((3.0 * t - 2.0) * t);
                ProfilePoint { at, tangent: along, arc: 0.0 }
            })
            .collect()
    }
}
