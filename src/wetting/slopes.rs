//! How steep a surface is, texel by texel.

/// `facing_up` of a texel that faces up.
const STRAIGHT_UP: f32 = 127.0;

/// What of a surface's shape changes with its pose.
pub(super) struct Slopes {
    /// Metres above the lowest, by texel.
    height: Vec<f32>,
    /// By texel, 127 for 1.
    facing_up: Vec<i8>,
    /// Length of a texel along u and v, metres, by triangle.
    lengths: Vec<[f32; 2]>,
}

impl Slopes {
    /// `heights` of all texels above anything, metres; none, or not a number, where nothing lies. `facing` up of all
    /// triangles, -1..=1, and `lengths` of a texel on them, metres and above 0. `owners`: the triangles of the texels; those
    /// without one may have any number that no triangle has.
    pub(super) fn new(
        heights: impl Iterator<Item = Option<f32>>,
        owners: &[u32],
        facing: impl Iterator<Item = f32>,
        lengths: Vec<[f32; 2]>,
    ) -> Self {
        let finite = |height: Option<f32>| height.filter(|height| height.is_finite()).unwrap_or(f32::NAN);
        let mut height: Vec<f32> = heights.map(finite).collect();
        // The minimum of a number and NaN is the number.
        let lowest = height.iter().copied().fold(f32::INFINITY, f32::min);
        for height in &mut height {
            *height = if height.is_nan() { 0.0 } else { *height - lowest };
        }
        let facing: Vec<i8> =
            facing.map(|cosine| (cosine.clamp(-1.0, 1.0) * STRAIGHT_UP).round() as i8).collect();
        let facing_up =
            owners.iter().map(|&owner| facing.get(owner as usize).copied().unwrap_or(0)).collect();
        Self { height, facing_up, lengths }
    }

    #[inline]
    pub(super) fn height(&self) -> &[f32] {
        &self.height
    }

    #[inline]
    pub(super) fn facing_up(&self, texel: u32) -> f32 {
        f32::from(self.facing_up[texel as usize]) / STRAIGHT_UP
    }

    /// Of the triangle with this number; none if there is no such triangle.
    #[inline]
    pub(super) fn lengths(&self, triangle: u32) -> Option<&[f32; 2]> {
        self.lengths.get(triangle as usize)
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.height.capacity() * size_of::<f32>()
            + self.facing_up.capacity()
            + self.lengths.capacity() * size_of::<[f32; 2]>()
    }
}
