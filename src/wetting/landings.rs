//! Where what falls over the border of an island comes to lie, shared out evenly among the texels there.
//!
//! Beyond a border the island of a stamp goes on as another one, which may be turned and scaled on the map. If each texel over
//! which the stamp hangs out went to one texel there, some would get two shares and some none. So each is shared
//! out: its image over there is a turned square, and the box around that covers parts of a few texels. Boxes lie over each
//! other unevenly, and end at the border, so the parts are balanced: in turn, those of a texel that would get more
//! than its area is worth shrink, those of one that would get less grow, and those of each source are made to add up again
//! (Sinkhorn and Knopp 1967). A film of one depth on this side is then nearly of one depth on the other.
//!
//! Amounts are cut at sums of parts, so that not a unit is lost; the largest part is the last, and has what is rounded off.
//!
//! Not here: images wider than [`WIDEST`], of which the box is cut; texels from which no way leads over a seam.
//!
//! - Sinkhorn and Knopp 1967, *Concerning nonnegative matrices and doubly stochastic matrices*.

use super::finder::{Finder, Image};

/// Columns and rows that a box covers at most.
const WIDEST: f64 = 4.0;

/// Parts of a box that are too small to count.
const LEAST_PART: f64 = 1.0 / 64.0;

/// How often parts are balanced.
const ROUNDS: u32 = 8;

/// By how much a part grows or shrinks at once, at most.
const AT_ONCE: f64 = 2.0;

/// By how much areas of texels are taken to differ, at most.
const MOST_RATIO: f64 = 64.0;

/// Of all islands: texels beside each, and who shares what falls there from it.
#[derive(Default)]
pub(super) struct Landings {
    /// For each island where its rows begin, and then where those of the last one end.
    starts: Vec<u32>,
    /// A texel, and where its parts begin; ascending within each island.
    rows: Vec<(u32, u32)>,
    texels: Vec<u32>,
    /// Parts up to each texel, itself included, of 65,536; that of the last one of a row is all.
    untils: Vec<u16>,
}

/// Who gets what falls over a texel.
pub(crate) enum Landing<'a> {
    /// One texel gets all of it.
    One(u32),
    /// These do, up to so many parts of 65,536 together, and the last one what is left.
    Shared(&'a [u32], &'a [u16]),
}

impl Landing<'_> {
    /// Shares out an amount: `give` is called with texels and what they get, above 0 and together all of it.
    #[inline]
    pub(crate) fn share(&self, amount: u64, mut give: impl FnMut(u32, u64)) {
        match *self {
            Self::One(texel) => give(texel, amount),
            Self::Shared(texels, untils) => {
                let mut given = 0;
                for (number, (&texel, &until)) in texels.iter().zip(untils).enumerate() {
                    let is_last = number + 1 == texels.len();
                    let sum = if is_last { amount } else { part_of(amount, until) };
                    if sum > given {
                        give(texel, sum - given);
                        given = sum;
                    }
                }
            }
        }
    }
}

/// `amount · part / 65,536`, rounded down.
fn part_of(amount: u64, part: u16) -> u64 {
    let part = u64::from(part);
    (amount >> 16) * part + (((amount & 0xffff) * part) >> 16)
}

impl Landings {
    /// Who shares what falls over a texel from an island; None if one gets all.
    pub(super) fn get(&self, island: u32, texel: u32) -> Option<Landing<'_>> {
        let [from, until] = [0, 1].map(|end| self.starts[island as usize + end] as usize);
        let index = from + self.rows[from..until].binary_search_by_key(&texel, |&(texel, _)| texel).ok()?;
        let first = self.rows[index].1 as usize;
        let end = self.rows.get(index + 1).map_or(self.texels.len(), |&(_, end)| end as usize);
        Some(Landing::Shared(&self.texels[first..end], &self.untils[first..end]))
    }

    /// Takes over what falls from an island; islands come in ascending order. The buffers are empty then.
    pub(super) fn add(&mut self, island: u32, sharing: &mut Sharing) {
        self.end(island);
        sharing.balance();
        let Sharing { sources, parts, .. } = sharing;
        sources.sort_unstable_by_key(|source| source.texel);
        for source in sources.iter() {
            let parts = &mut parts[source.first..source.end];
            // What is one texel's is known without.
            if parts.len() < 2 {
                continue;
            }
            parts.sort_unstable_by(|one, other| {
                one.weight.total_cmp(&other.weight).then(one.texel.cmp(&other.texel))
            });
            self.rows.push((source.texel, self.texels.len() as u32));
            let mut sum = 0.0;
            for part in parts.iter() {
                sum += part.weight;
                self.texels.push(part.texel);
                self.untils.push((sum * 65_536.0).min(65_535.0) as u16);
            }
        }
        sources.clear();
        parts.clear();
    }

    /// Islands before this one have no more than they have got.
    pub(super) fn end(&mut self, island: u32) {
        self.starts.resize(island as usize + 1, self.rows.len() as u32);
    }

    /// Gives back memory that is not needed.
    pub(super) fn shrink(&mut self) {
        self.rows.shrink_to_fit();
        self.texels.shrink_to_fit();
        self.untils.shrink_to_fit();
    }

    /// Memory held, bytes.
    pub(super) fn bytes(&self) -> usize {
        (self.starts.capacity() + self.texels.capacity()) * size_of::<u32>()
            + self.rows.capacity() * size_of::<(u32, u32)>()
            + self.untils.capacity() * size_of::<u16>()
    }
}

/// How what falls beside one island is shared out, while it is found.
#[derive(Default)]
pub(super) struct Sharing {
    sources: Vec<Source>,
    parts: Vec<Part>,
    /// Texels that have parts, ascending, and what each gets, as a multiple of what its area is worth.
    targets: Vec<u32>,
    sums: Vec<f64>,
}

/// A texel that is shared out, and where its parts begin and end.
struct Source {
    texel: u32,
    first: usize,
    end: usize,
}

/// What a texel gets of another one.
struct Part {
    texel: u32,
    /// Its place among the targets.
    target: usize,
    weight: f64,
    /// The area of the source, in areas of the texel.
    ratio: f64,
}

impl Sharing {
    /// Adds a texel over which an island hangs out whose triangles are of `area` a texel, in m², and what its image lies over.
    /// `islands`: of all triangles.
    pub(super) fn add(&mut self, finder: &Finder, islands: &[u32], texel: u32, area: f64, image: &Image) {
        let (grid, first) = (finder.grid, self.parts.len());
        let island_of = |texel: u32| finder.owners.of(texel).map(|owner| islands[owner as usize]);
        let island = island_of(image.other);
        let half = image.half.min(WIDEST / 2.0);
        let span = |middle: f64| (middle - half).floor() as i32..=(middle + half).floor() as i32;
        // The part of the box that lies in a column or row.
        let covered = |middle: f64, number: i32| {
            let from = f64::from(number);
            ((middle + half).min(from + 1.0) - (middle - half).max(from)) / (2.0 * half)
        };
        for row in span(image.middle.y) {
            for column in span(image.middle.x) {
                let weight = covered(image.middle.x, column) * covered(image.middle.y, row);
                if weight <= 0.0 {
                    continue;
                }
                let is_meant = |&there: &u32| {
                    weight >= LEAST_PART
                        && island_of(there) == island
                        && finder.is_around(&image.place, there)
                };
                let there = grid.holds(column, row).then(|| grid.texel(column, row)).filter(is_meant);
                self.give(finder, first, there.unwrap_or(image.other), area, weight);
            }
        }
        self.sources.push(Source { texel, first, end: self.parts.len() });
    }

    /// Adds to what a texel has of the source whose parts begin there.
    fn give(&mut self, finder: &Finder, first: usize, texel: u32, area: f64, weight: f64) {
        if let Some(part) = self.parts[first..].iter_mut().find(|part| part.texel == texel) {
            part.weight += weight;
            return;
        }
        let ratio = finder.owners.of(texel).map_or(1.0, |owner| area / finder.texel_area(owner));
        let ratio = if ratio.is_finite() { ratio.clamp(MOST_RATIO.recip(), MOST_RATIO) } else { 1.0 };
        self.parts.push(Part { texel, target: 0, weight, ratio });
    }

    /// Evens out what all targets get; afterwards the parts of each source are 1 together.
    fn balance(&mut self) {
        let Self { sources, parts, targets, sums } = self;
        targets.clear();
        targets.extend(parts.iter().map(|part| part.texel));
        targets.sort_unstable();
        targets.dedup();
        for part in parts.iter_mut() {
            part.target = targets.partition_point(|&texel| texel < part.texel);
        }
        for _ in 0..ROUNDS {
            sums.clear();
            sums.resize(targets.len(), 0.0);
            parts.iter().for_each(|part| sums[part.target] += part.weight * part.ratio);
            for source in sources.iter() {
                let parts = &mut parts[source.first..source.end];
                for part in parts.iter_mut() {
                    part.weight *= sums[part.target].recip().clamp(AT_ONCE.recip(), AT_ONCE);
                }
                let sum: f64 = parts.iter().map(|part| part.weight).sum();
                parts.iter_mut().for_each(|part| part.weight /= sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::TexelGeometry;
    use super::super::points::surface_points;
    use super::super::test_meshes::{floor, joined, sheet, turned_neighbours};
    use super::*;
    use crate::overlay::Wrap;
    use bevy::math::{Affine3A, Vec2, Vec3};

    const SIZE: u32 = 128;
    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    /// The largest and the least over the mean of what texels get within 8 texels of a seam, away from its ends.
    fn evenness(got: &[u64]) -> [f64; 2] {
        let mesh = turned_neighbours();
        let points = surface_points(&mesh, &Affine3A::IDENTITY, SIZE, WRAP);
        let is_near = |at: Vec3| (1.0..1.0 + 8.0 / 36.0).contains(&at.x) && (0.2..0.8).contains(&at.z);
        let near = points.iter().filter(|point| point.triangle >= 32 && is_near(point.position));
        let near: Vec<f64> = near.map(|point| got[point.texel as usize] as f64).collect();
        assert!(near.len() > 200, "{}", near.len());
        let mean = near.iter().sum::<f64>() / near.len() as f64;
        [near.iter().copied().fold(0.0, f64::max), near.iter().copied().fold(f64::INFINITY, f64::min)]
            .map(|extreme| extreme / mean)
    }

    #[test]
    fn texels_of_a_turned_and_scaled_neighbour_get_as_much_as_each_other() {
        let mesh = turned_neighbours();
        let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, SIZE, WRAP);
        let mut got = [vec![0u64; (SIZE * SIZE) as usize], vec![0u64; (SIZE * SIZE) as usize]];
        // An odd amount, and one of which most parts are nothing, on each texel over which the first island hangs out.
        for amount in [1_000_003, 1] {
            let before: u64 = got[0].iter().sum();
            let mut count = 0;
            for over in (10..46).flat_map(|row| (40..54).map(move |column| row * SIZE + column)) {
                assert_eq!(geometry.owner(over), None);
                let home = 28 * SIZE + 39;
                let landing = geometry.landing(Some(0), over, home).unwrap();
                landing.share(amount, |texel, part| {
                    assert!(part > 0 && geometry.owner(texel).is_some(), "{over} {texel}");
                    got[0][texel as usize] += part;
                });
                got[1][geometry.on_island(0, over, home) as usize] += amount;
                count += 1;
            }
            assert_eq!(got[0].iter().sum::<u64>() - before, amount * count);
        }
        let [[most, least], [most_by_one, least_by_one]] = got.map(|got| evenness(&got));
        assert!(most < 1.25 && least > 0.75, "{most} {least}");
        // One by one it would not be so.
        assert!(most_by_one > 1.4 && least_by_one == 0.0, "{most_by_one} {least_by_one}");
    }

    #[test]
    fn an_island_of_a_few_texels_gets_on_each_what_that_is_worth_over_the_edge_of_the_map_too() {
        const AMOUNT: u64 = 1_000_003;
        for (column, wrap) in [(90, WRAP), (127, [Wrap::Repeat; 2])] {
            // Twelve columns and rows of the one on each of the other.
            let first = sheet(4, floor, |point| (Vec2::new(4.3, 10.0) + point * 36.0) / 128.0);
            let corner = Vec2::new(column as f32, 50.0);
            let second =
                sheet(4, |point| floor(point) + Vec3::X, move |point| (corner + point * 3.0) / 128.0);
            let mesh = joined([first, second]);
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, SIZE, wrap);
            let mut got = vec![0u64; (SIZE * SIZE) as usize];
            for over in (10..46).flat_map(|row| (40..54).map(move |column| row * SIZE + column)) {
                let landing = geometry.landing(Some(0), over, 28 * SIZE + 39).unwrap();
                landing.share(AMOUNT, |texel, part| {
                    assert!(geometry.owner(texel).is_some_and(|owner| owner >= 32), "{over} {texel}");
                    got[texel as usize] += part;
                });
            }
            assert_eq!(got.iter().sum::<u64>(), AMOUNT * 36 * 14);
            for row in 50..53 {
                let [near, next] =
                    [column, (column + 1) % SIZE].map(|column| got[(row * SIZE + column) as usize]);
                assert!((143 * AMOUNT..148 * AMOUNT).contains(&near), "{column} {row}: {near}");
                assert!(next > 19 * AMOUNT, "{column} {row}: {next}");
            }
        }
    }

    #[test]
    fn an_amount_is_shared_out_to_the_unit() {
        let shared = Landing::Shared(&[7, 3, 9], &[0, 20_000, 65_535]);
        for amount in [1, 2, 5, 65_537, u64::from(u32::MAX) * 1000 + 1] {
            let mut parts = Vec::new();
            shared.share(amount, |texel, part| parts.push((texel, part)));
            assert_eq!(parts.iter().map(|&(_, part)| part).sum::<u64>(), amount);
            assert!(parts.iter().all(|&(texel, part)| texel != 7 && part > 0), "{parts:?}");
        }
        let mut parts = Vec::new();
        Landing::One(5).share(12, |texel, part| parts.push((texel, part)));
        assert_eq!(parts, [(5, 12)]);
    }
}
