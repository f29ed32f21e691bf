//! The textures and the buffer of a surface.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::storage::ShaderBuffer;

use super::copies::MapCopies;
use crate::matter::GpuTexelMatter;
use crate::overlay::resample::is_reached;
use crate::overlay::{MapSize, RainRing, SplatQueue, TILE_SIZE, Weatherable, Wrap, mip_levels};
use crate::wetting::gpu::GpuTexelWater;

/// The maps of a surface on the GPU. Begin empty; all zeros mean "nothing here". Each is as small as can be until there is
/// something to put there. The three images have [`mip_levels`] levels, which follow what is painted.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component)]
pub struct Overlays {
    /// Texels along each side.
    pub size: u32,
    /// Edge behaviour along u and v.
    pub wrap: [Wrap; 2],
    /// Colour over the surface's; linear `rgba8unorm`, premultiplied. This and the next two are a tile each while nothing has
    /// been painted.
    pub diffuse: Handle<Image>,
    /// Reflectance, smoothness, unused, coverage; `rgba8unorm`, premultiplied.
    pub specular: Handle<Image>,
    /// Slope towards growing u and v (128 of 255 is flat), unused, coverage; `rgba8unorm`, premultiplied. See
    /// [`normals`](crate::material::normals).
    pub normal: Handle<Image>,
    /// [`GpuTexelWater`] of each texel, tile by tile; a single one while nothing has been wet.
    pub state: Handle<ShaderBuffer>,
    /// `state` has room for all texels.
    pub has_room: bool,
    /// [`GpuTexelMatter`] of each texel, tile by tile; a single one while nothing of it has come.
    pub matter: Handle<ShaderBuffer>,
    /// `matter` has room for all texels.
    pub has_matter_room: bool,
    /// [`RainRing::PER_TILE`] [`RainRing`]s of each tile, row by row; those of a single one while nothing has fallen.
    pub rings: Handle<ShaderBuffer>,
    /// `rings` has room for all tiles.
    pub has_rings: bool,
    /// The colour maps have room for all texels.
    pub has_colors: bool,
}

impl Overlays {
    fn new(
        size: u32,
        wrap: [Wrap; 2],
        images: &mut Assets<Image>,
        buffers: &mut Assets<ShaderBuffer>,
    ) -> Self {
        let [diffuse, specular, normal] = overlay_images(TILE_SIZE, wrap, images);
        // wgpu zeroes what is created without data.
        let mut buffer = |bytes| buffers.add(ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD));
        let state = buffer(size_of::<GpuTexelWater>());
        let matter = buffer(size_of::<GpuTexelMatter>());
        let rings = buffer(ring_bytes(TILE_SIZE));
        Self {
            size,
            wrap,
            diffuse,
            specular,
            normal,
            state,
            has_room: false,
            matter,
            has_matter_room: false,
            rings,
            has_rings: false,
            has_colors: false,
        }
    }

    /// Maps that repeat, and are nowhere on a GPU.
    #[cfg(test)]
    pub(crate) fn bare(size: u32) -> Self {
        Self {
            size,
            wrap: [Wrap::Repeat; 2],
            diffuse: default(),
            specular: default(),
            normal: default(),
            state: default(),
            has_room: false,
            matter: default(),
            has_matter_room: false,
            rings: default(),
            has_rings: false,
            has_colors: false,
        }
    }

    /// Makes room for what is painted.
    pub(crate) fn open_colors(&mut self, images: &mut Assets<Image>) {
        [self.diffuse, self.specular, self.normal] = overlay_images(self.size, self.wrap, images);
        self.has_colors = true;
    }

    /// Makes room for rings around drops.
    fn open_rings(&mut self, buffers: &mut Assets<ShaderBuffer>) {
        let rings = ShaderBuffer::with_size(ring_bytes(self.size), RenderAssetUsages::RENDER_WORLD);
        self.rings = buffers.add(rings);
        self.has_rings = true;
    }

    /// Whether there is room for what waits.
    pub(super) fn is_open_for(&self, queue: &SplatQueue) -> bool {
        self.has_rings && (self.has_colors || !queue.has_painted())
    }
}

/// [`Overlays`] by name, so that nothing here keeps the maps of a surface that has gone or got others.
#[derive(Clone, Copy)]
pub(super) struct Maps {
    pub(super) size: u32,
    pub(super) wrap: [Wrap; 2],
    pub(super) images: [AssetId<Image>; 3],
    pub(super) rings: AssetId<ShaderBuffer>,
}

impl From<&Overlays> for Maps {
    fn from(overlays: &Overlays) -> Self {
        Self {
            size: overlays.size,
            wrap: overlays.wrap,
            images: [overlays.diffuse.id(), overlays.specular.id(), overlays.normal.id()],
            rings: overlays.rings.id(),
        }
    }
}

/// Bytes of the rings of maps with so many texels along each side.
fn ring_bytes(size: u32) -> usize {
    ((size / TILE_SIZE).pow(2) * RainRing::PER_TILE) as usize * size_of::<RainRing>()
}

/// Empty colour maps: diffuse, specular, normal.
fn overlay_images(size: u32, wrap: [Wrap; 2], images: &mut Assets<Image>) -> [Handle<Image>; 3] {
    ["diffuse overlay", "specular overlay", "normal overlay"]
        .map(|name| images.add(overlay_image(size, wrap, name)))
}

fn overlay_image(size: u32, wrap: [Wrap; 2], name: &'static str) -> Image {
    let extent = Extent3d { width: size, height: size, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(
        extent,
        TextureDimension::D2,
        TextureFormat::Rgba8Unorm,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.label = Some(name);
    image.texture_descriptor.usage |= TextureUsages::STORAGE_BINDING;
    image.texture_descriptor.mip_level_count = mip_levels(size);
    let [address_mode_u, address_mode_v] = wrap.map(|wrap| match wrap {
        Wrap::Repeat => ImageAddressMode::Repeat,
        Wrap::Clamp => ImageAddressMode::ClampToEdge,
    });
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u,
        address_mode_v,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

/// Gives new surfaces their maps, and new ones when their size or edges change. Where only the size does, to twice the side or a half,
/// a quarter and so on, what has been painted moves over; whatever else is edited leaves it.
pub(super) fn add_overlays(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut changed: Query<
        (Entity, &Weatherable, &MapSize, Option<&Overlays>, Option<&mut MapCopies>),
        Or<(Changed<Weatherable>, Changed<MapSize>)>,
    >,
) {
    for (entity, surface, size, maps, copies) in &mut changed {
        let (size, wrap) = (size.texels(), surface.wrap());
        if maps.is_some_and(|maps| (maps.size, maps.wrap) == (size, wrap)) {
            continue;
        }
        let mut new = Overlays::new(size, wrap, &mut images, &mut buffers);
        if let Some(old) = maps
            && old.has_colors
            && old.wrap == wrap
            && is_reached(old.size, size)
            && size <= 2 * old.size
        {
            new.open_colors(&mut images);
            new.open_rings(&mut buffers);
            match copies {
                Some(mut copies) => copies.push(old, &new),
                None => {
                    let mut copies = MapCopies::default();
                    copies.push(old, &new);
                    commands.entity(entity).insert(copies);
                }
            }
        }
        commands.entity(entity).insert(new);
    }
}

/// Makes room on surfaces for which the first splats wait.
pub(super) fn open_overlays(
    mut images: ResMut<Assets<Image>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut surfaces: Query<(&mut Overlays, &SplatQueue)>,
) {
    for (mut overlays, queue) in &mut surfaces {
        if queue.is_empty() {
            continue;
        }
        if !overlays.has_rings {
            overlays.open_rings(&mut buffers);
        }
        if !overlays.has_colors && queue.has_painted() {
            overlays.open_colors(&mut images);
        }
    }
}

/// Drops the maps of a surface that has lost its size.
pub(super) fn release_overlays(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<(Overlays, MapCopies)>();
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::overlay::{Splat, StampSpace};

    #[test]
    fn colour_maps_have_room_once_something_paints() {
        let mut world = World::new();
        world.init_resource::<Assets<Image>>();
        world.init_resource::<Assets<ShaderBuffer>>();
        let surface = world.spawn((Overlays::bare(64), SplatQueue::default())).id();
        let mut schedule = Schedule::default();
        schedule.add_systems(open_overlays);
        let mut after = |splat: Option<Splat>| {
            splat.into_iter().for_each(|splat| world.get_mut::<SplatQueue>(surface).unwrap().push(splat));
            schedule.run(&mut world);
            let maps = world.get::<Overlays>(surface).unwrap();
            (maps.has_rings, maps.has_colors)
        };
        let water = Splat { water_nl: 7, ..Splat::zeroed() };
        assert_eq!(after(None), (false, false));
        assert_eq!(after(Some(water)), (true, false));
        assert_eq!(after(Some(Splat { diffuse: u32::MAX, ..water })), (true, true));
    }

    #[test]
    fn only_another_size_or_other_edges_cost_what_has_been_painted() {
        let mut world = World::new();
        world.init_resource::<Assets<Image>>();
        world.init_resource::<Assets<ShaderBuffer>>();
        let of_size = |map_size| Weatherable { map_size, ..default() };
        let surface = world.spawn((of_size(64), MapSize::whole(&of_size(64)))).id();
        let mut schedule = Schedule::default();
        schedule.add_systems(add_overlays);
        let mut after = |edit: &dyn Fn(&mut World)| {
            edit(&mut world);
            schedule.run(&mut world);
            world.get::<Overlays>(surface).unwrap().rings.id()
        };
        let first = after(&|_| {});
        let same = after(&|world| {
            let mut edited = world.get_mut::<Weatherable>(surface).unwrap();
            edited.stamps = StampSpace::Map;
            world.get_mut::<MapSize>(surface).unwrap().set_changed();
        });
        assert_eq!(first, same);
        let wrapped = after(&|world| world.get_mut::<Weatherable>(surface).unwrap().wrap_u = Wrap::Clamp);
        assert_ne!(first, wrapped);
        let larger = after(&|world| {
            world.entity_mut(surface).insert(MapSize::whole(&of_size(128)));
        });
        assert_ne!(wrapped, larger);
        // As when a scene is taken back to its beginning.
        let emptied = after(&|world| {
            world.entity_mut(surface).remove::<Overlays>();
            world.get_mut::<Weatherable>(surface).unwrap().set_changed();
        });
        assert_ne!(larger, emptied);
    }
}
