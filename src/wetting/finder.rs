//! What lies beside a texel on the mesh.

use bevy::math::DVec2;

use super::grid::{Grid, Side};
use super::links::Link;
use super::ownership::{NOBODY, Ownership};
use super::walk::{Leg, Place, Surface};

/// How many times as far the way may lead if it ends in the texel it began in.
const LONGEST_STEP: i32 = 3;

/// Where the first sample behind a seam lies, in texels: past the seam in spite of rounding.
const PAST_THE_SEAM: f64 = 1.0 / 64.0;

/// Distance between two samples behind a seam, in texels.
const SAMPLES_APART: f64 = 0.5;

/// Samples on one triangle behind a seam, at most.
const MAX_SAMPLES: u32 = 64;

/// The shortest part of a way that tells a direction, in texels.
const SHORTEST_WAY: f64 = 1e-4;

/// How far a texel is sought in place of one that no triangle owns, in texels along each axis.
const SEARCH_TEXELS: i32 = 2;

/// How far, in reaches of a triangle, the middle of a texel may lie from a place that falls into it: half,
/// and what bends and changes of density add.
const SAME_TEXEL_REACHES: f64 = 0.6;

/// The same for the middles of texels side by side.
const NEIGHBOUR_REACHES: f64 = 1.2;

/// The same for a place and a texel that is sought around it.
const SEARCH_REACHES: f64 = 3.0;

/// The same for the middles of texels side by side, if the parts of the mesh that they lie on are to count as one.
const SIDE_BY_SIDE_REACHES: f64 = 0.75;

/// Finds texels along ways over the surface.
pub(super) struct Finder<'a> {
    pub(super) grid: Grid,
    pub(super) surface: &'a Surface,
    pub(super) owners: &'a Ownership,
    /// For each triangle, how long a texel is along u and along v together, metres; 0 if that cannot be told.
    /// From the middle of a texel to any point of it is no further than half of that.
    reach: Vec<f64>,
    /// For each triangle the area of a texel, m²; 0 or not a number if that cannot be told.
    texel_area: Vec<f64>,
}

/// Where a way over the surface ends, and which texel stands for that.
pub(super) struct Across {
    last: Leg,
    pub(super) other: u32,
}

/// Where a texel comes to lie behind a seam.
pub(super) struct Image {
    /// The texel that its middle comes to, or stands for that.
    pub(super) other: u32,
    /// Where its middle comes to, on the surface and on the map, in texels of any tile.
    pub(super) place: Place,
    pub(super) middle: DVec2,
    /// Half the width of the box around it, in texels.
    pub(super) half: f64,
}

/// Where a way ends.
enum End {
    Texel(u32),
    /// In the texel in which it began.
    Itself,
    MeshEnds,
    /// At a place for which no texel stands, or one far from it: and which will do if need be.
    Elsewhere(Option<u32>),
}

impl<'a> Finder<'a> {
    pub(super) fn new(grid: Grid, surface: &'a Surface, owners: &'a Ownership) -> Self {
        let measure = |triangle: u32| {
            let [along_u, along_v] =
                [DVec2::X, DVec2::Y].map(|step| surface.step_in_space(triangle, step).unwrap_or_default());
            let reach = along_u.length() + along_v.length();
            (if reach.is_finite() { reach } else { 0.0 }, along_u.cross(along_v).length())
        };
        let (reach, texel_area) = (0..surface.map.len() as u32).map(measure).unzip();
        Self { grid, surface, owners, reach, texel_area }
    }

    /// The area of a texel on a triangle, m²; 0 or not a number if that cannot be told.
    pub(super) fn texel_area(&self, triangle: u32) -> f64 {
        self.texel_area[triangle as usize]
    }

    /// Where an owned texel lies on its triangle.
    pub(super) fn place(&self, texel: u32) -> Option<Place> {
        let triangle = self.owners.of(texel)?;
        let [second, third] = self.owners.weights[texel as usize].map(f64::from);
        Some(Place { triangle, weights: [1.0 - second - third, second, third] })
    }

    /// The texel that lies on a side of an owned texel, on the mesh.
    pub(super) fn link(&self, texel: u32, side: Side) -> Link {
        let Some(start) = self.place(texel) else { return Link::Edge };
        let beside = self.grid.beside(texel, side.offset()).filter(|&other| self.owners.of(other).is_some());
        let [columns, rows] = side.offset().map(f64::from);
        let (mut spare, mut moved) = (None, false);
        for length in (1..=LONGEST_STEP).map(f64::from) {
            let Some(end) = self.end(texel, start, DVec2::new(columns, rows) * length) else {
                // The triangle is a line on the map and has no directions there.
                let near = beside.filter(|&other| self.is_near(&start, other, NEIGHBOUR_REACHES));
                return near.map_or(Link::Edge, Link::Texel);
            };
            match end {
                End::Texel(other) => return Link::Texel(other),
                End::MeshEnds => return spare.map_or(Link::Edge, Link::Texel),
                End::Itself => {}
                End::Elsewhere(other) => {
                    spare = spare.or(other);
                    moved = true;
                }
            }
        }
        spare.or(beside.filter(|_| !moved)).map_or(Link::Edge, Link::Texel)
    }

    /// The way from an owned texel so many columns and rows on; None if the mesh ends before, or no texel is found there.
    pub(super) fn across(&self, texel: u32, [columns, rows]: [i32; 2]) -> Option<Across> {
        let step = DVec2::new(f64::from(columns), f64::from(rows));
        let last = self.surface.walk(self.place(texel)?, step)?.last().filter(|last| !last.mesh_ends)?;
        match self.at_end(&last, NOBODY, None) {
            End::Texel(other) | End::Elsewhere(Some(other)) => Some(Across { last, other }),
            End::Itself | End::MeshEnds | End::Elsewhere(None) => None,
        }
    }

    /// The texel that stands for the surface so many columns and rows away from an owned texel; the texel
    /// itself where the mesh ends before.
    pub(super) fn stand_in(&self, texel: u32, offset: [i32; 2]) -> u32 {
        self.across(texel, offset).map_or(texel, |across| across.other)
    }

    /// The same from the border of an island to a texel that is not the island's: that one itself if no way leads there, and it
    /// lies in space where the way would have ended. Planks beside each other are one wall to what falls on them. `across`: the way.
    pub(super) fn stray(&self, from: u32, offset: [i32; 2], there: u32, across: Option<&Across>) -> u32 {
        match across.map_or(from, |across| across.other) {
            other if other == from && self.lies_ahead(from, offset, there) => there,
            other => other,
        }
    }

    /// Where the texel comes to lie that lies so many columns and rows beside an owned one, at the end of the way `across`. None
    /// if that leads over no seam.
    pub(super) fn image(&self, from: u32, [columns, rows]: [i32; 2], across: &Across) -> Option<Image> {
        let &Across { last, other } = across;
        let (before, behind) = (self.owners.of(from)?, last.to.triangle);
        let middle = self.surface.on_map(&last.to);
        let way = middle - self.surface.on_map(&last.from);
        // A mirror turns each step another way, but the one along u and its mirrored ones.
        let mirror = if self.winding(before) == self.winding(behind) { 1.0 } else { -1.0 };
        let step = DVec2::new(f64::from(columns), f64::from(rows) * mirror);
        // The sine and the cosine of the angle by which the texel is turned: together the width of the box around it.
        let turned = (way.dot(step).abs() + way.perp_dot(step).abs()) / (way.length() * step.length());
        let turned = if way.length() > SHORTEST_WAY { turned } else { 1.0 };
        let scale = (self.texel_area(before) / self.texel_area(behind)).sqrt();
        let half = scale * turned / 2.0;
        let is_found = last.over_seam && half.is_finite() && half > 0.0;
        is_found.then_some(Image { other, place: last.to, middle, half })
    }

    /// Whether a triangle is wound counter-clockwise on the map.
    fn winding(&self, triangle: u32) -> bool {
        let [a, b, c] = self.surface.map[triangle as usize];
        (b - a).perp_dot(c - a) > 0.0
    }

    /// Whether an owned texel is of the surroundings of a place in space.
    pub(super) fn is_around(&self, place: &Place, texel: u32) -> bool {
        self.is_near(place, texel, SEARCH_REACHES)
    }

    /// The owned texel nearest in space to a place on a triangle that owns no texel there: of those around a texel in the image, and
    /// of those to which ways lead from the place, over seams, too. If none is near, one of the triangle's island.
    /// `is_own`: whether a triangle is of that.
    pub(super) fn nearest_to(&self, place: &Place, around: u32, is_own: impl Fn(u32) -> bool) -> Option<u32> {
        let point = self.surface.in_space(place);
        let distance = |texel: u32| {
            let other = self.place(texel).map(|other| self.surface.in_space(&other));
            other.map_or(f64::INFINITY, |other| other.distance_squared(point))
        };
        let lengths = || (1..=LONGEST_STEP).map(f64::from);
        let steps = Side::ALL.into_iter().flat_map(|side| {
            let [columns, rows] = side.offset().map(f64::from);
            lengths().map(move |length| DVec2::new(columns, rows) * length)
        });
        let at_ends = steps.filter_map(|step| match self.end(NOBODY, *place, step)? {
            End::Texel(other) | End::Elsewhere(Some(other)) => Some(other),
            End::Itself | End::MeshEnds | End::Elsewhere(None) => None,
        });
        let is_meant = |&other: &u32| {
            self.owners.of(other) == Some(place.triangle) || self.is_near(place, other, SEARCH_REACHES)
        };
        let near = self.nearest(place, around, None).into_iter().chain(at_ends).filter(is_meant);
        near.min_by(|&one, &other| distance(one).total_cmp(&distance(other)))
            .or_else(|| self.own_texel(place, is_own))
    }

    /// The first texel of a place's own island on the way from there to the middle of its triangle. Else the one in which the middle of
    /// the triangle's box lies, which is all that one has that covers no middle; if another of the island came first, it has it.
    fn own_texel(&self, place: &Place, is_own: impl Fn(u32) -> bool) -> Option<u32> {
        let [a, b, c] = self.surface.map[place.triangle as usize];
        let middle_of_box = ((a.min(b).min(c) + a.max(b).max(c)) / 2.0).as_dvec2();
        let middle = Place { triangle: place.triangle, weights: [1.0 / 3.0; 3] };
        let [from, to] = [place, &middle].map(|place| self.surface.on_map(place));
        let steps = (from.distance(to) / SAMPLES_APART).ceil().max(1.0);
        (0..=steps as u32)
            .map(|step| self.grid.at(from.lerp(to, f64::from(step) / steps)))
            .chain([self.grid.at(middle_of_box)])
            .find(|&texel| self.owners.of(texel).is_some_and(&is_own))
    }

    /// Whether a texel lies straight ahead of another in space, by as much as in the image.
    fn lies_ahead(&self, from: u32, [columns, rows]: [i32; 2], there: u32) -> bool {
        let (Some(start), Some(place)) = (self.place(from), self.place(there)) else { return false };
        let step = DVec2::new(f64::from(columns), f64::from(rows));
        let Some(step) = self.surface.step_in_space(start.triangle, step) else { return false };
        let reach = self.reach[start.triangle as usize].max(self.reach[place.triangle as usize]);
        let ahead = self.surface.in_space(&start) + step;
        ahead.distance(self.surface.in_space(&place)) <= reach * SAME_TEXEL_REACHES
    }

    /// Whether two texels that lie side by side in the image do so in space.
    pub(super) fn lie_side_by_side(&self, texel: u32, other: u32) -> bool {
        self.place(texel).is_some_and(|place| self.is_near(&place, other, SIDE_BY_SIDE_REACHES))
    }

    /// Follows a way from a texel. None if its triangle has no directions on the map.
    fn end(&self, texel: u32, start: Place, step: DVec2) -> Option<End> {
        let mut last = None;
        for leg in self.surface.walk(start, step)? {
            // Behind a seam the first texel counts, not the one at the end: which of an island's outermost
            // texels still have their middles on the mesh is chance, and none may be stepped over.
            if let Some(other) = self.first_behind_seam(&leg, texel) {
                return Some(End::Texel(other));
            }
            if leg.mesh_ends {
                return Some(End::MeshEnds);
            }
            last = Some(leg);
        }
        Some(last.map_or(End::Itself, |last| self.at_end(&last, texel, Some(start))))
    }

    /// The first texel on a leg behind a seam that stands for what lies there, and is not where the way
    /// began.
    fn first_behind_seam(&self, leg: &Leg, began: u32) -> Option<u32> {
        if !leg.over_seam {
            return None;
        }
        let length = self.surface.on_map(&leg.from).distance(self.surface.on_map(&leg.to));
        (0..MAX_SAMPLES)
            .map(|sample| PAST_THE_SEAM + f64::from(sample) * SAMPLES_APART)
            .take_while(|&way| way < length)
            .find_map(|way| {
                let place = leg.at(way / length);
                let texel = self.grid.at(self.surface.on_map(&place));
                (texel != began && self.stands_for(&place, texel)).then_some(texel)
            })
    }

    /// The texel in which the last leg of a way ends that began in `began`, at `start`.
    fn at_end(&self, last: &Leg, began: u32, start: Option<Place>) -> End {
        let texel = self.grid.at(self.surface.on_map(&last.to));
        if texel == began {
            return End::Itself;
        }
        let owned = self.owners.of(texel).is_some();
        // Without a seam it is the texel beside in the image.
        if owned && (!last.over_seam || self.stands_for(&last.to, texel)) {
            return End::Texel(texel);
        }
        // If nothing that is near will do, an owner that lies elsewhere has its island on top of this one.
        End::Elsewhere(self.nearest(&last.to, texel, start).or(owned.then_some(texel)))
    }

    /// The texel nearest to a place on the surface, of those around one in the image that are not nearer to
    /// `start`.
    fn nearest(&self, place: &Place, around: u32, start: Option<Place>) -> Option<u32> {
        let (point, cell) = (self.surface.in_space(place), self.grid.cell(around));
        let start = start.map(|start| self.surface.in_space(&start));
        let mut best: Option<(f64, u32)> = None;
        for rows in -SEARCH_TEXELS..=SEARCH_TEXELS {
            for columns in -SEARCH_TEXELS..=SEARCH_TEXELS {
                let Some(texel) = self.grid.beside_cell(cell, [columns, rows]) else { continue };
                let Some(other) = self.place(texel) else { continue };
                if other.triangle != place.triangle && !self.is_near(place, texel, SEARCH_REACHES) {
                    continue;
                }
                let found = self.surface.in_space(&other);
                let distance = found.distance_squared(point);
                if start.is_some_and(|start| found.distance_squared(start) < distance) {
                    continue;
                }
                if best.is_none_or(|(least, _)| distance < least) {
                    best = Some((distance, texel));
                }
            }
        }
        best.map(|(_, texel)| texel)
    }

    /// Whether a texel into which a place falls on the map belongs to the surface there, and not to an island
    /// that is its neighbour only in the image.
    fn stands_for(&self, place: &Place, texel: u32) -> bool {
        self.owners.of(texel).is_some_and(|owner| owner == place.triangle)
            || self.is_near(place, texel, SAME_TEXEL_REACHES)
    }

    /// Whether an owned texel lies within so many reaches of a place, in space.
    fn is_near(&self, place: &Place, texel: u32, reaches: f64) -> bool {
        let Some(other) = self.place(texel) else { return false };
        let reach = self.reach[place.triangle as usize].max(self.reach[other.triangle as usize]);
        self.surface.in_space(&other).distance(self.surface.in_space(place)) <= reach * reaches
    }
}
