//! The textures and the buffer of a surface.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::storage::ShaderBuffer;

use crate::matter::GpuTexelMatter;
use crate::overlay::{RainRing, TILE_SIZE, Weatherable, Wrap, mip_levels};
use crate::wetting::gpu::GpuTexelWater;

/// The maps of a surface on the GPU. Begin empty; all zeros mean "nothing here". The three images have
/// [`mip_levels`] levels, which follow what is painted.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component)]
pub struct Overlays {
    /// Texels along each side.
    pub size: u32,
    /// Edge behaviour along u and v.
    pub wrap: [Wrap; 2],
    /// Colour over the surface's; linear `rgba8unorm`, premultiplied.
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
    /// [`RainRing::PER_TILE`] [`RainRing`]s of each tile, row by row.
    pub rings: Handle<ShaderBuffer>,
}

impl Overlays {
    fn new(surface: &Weatherable, images: &mut Assets<Image>, buffers: &mut Assets<ShaderBuffer>) -> Self {
        let size = surface.texels();
        let mut image = |name| images.add(overlay_image(size, surface.wrap(), name));
        let (diffuse, specular, normal) =
            (image("diffuse overlay"), image("specular overlay"), image("normal overlay"));
        // wgpu zeroes what is created without data.
        let mut buffer = |bytes| buffers.add(ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD));
        let state = buffer(size_of::<GpuTexelWater>());
        let matter = buffer(size_of::<GpuTexelMatter>());
        let tiles = (size / TILE_SIZE).pow(2);
        let rings = buffer((tiles * RainRing::PER_TILE) as usize * size_of::<RainRing>());
        Self {
            size,
            wrap: surface.wrap(),
            diffuse,
            specular,
            normal,
            state,
            has_room: false,
            matter,
            has_matter_room: false,
            rings,
        }
    }
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

/// Gives new surfaces their maps, and new ones when their size or edges change.
pub(super) fn add_overlays(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    changed: Query<(Entity, &Weatherable), Changed<Weatherable>>,
) {
    for (entity, surface) in &changed {
        commands.entity(entity).insert(Overlays::new(surface, &mut images, &mut buffers));
    }
}
