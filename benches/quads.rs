//! The baseline of [`overlap`](crate::overlap): stamps as quads, blended into render targets.
//!
//! What most decal and painting code does. Three maps of `rgba8unorm` are drawn into at once; a quad covers its stamp's
//! square and no more. An instance is packed into 32 bytes on the CPU and uploaded, in every call; what the library has in
//! its rows for stamps of the atlas and in space is left out. Order is that of the instances, so the same stamps lie on top;
//! the hardware rounds in its own way. Stamps end at the edges: wraparound would take up to four quads for one.

use bevy_weathering::overlay::Splat;
use bytemuck::{Pod, Zeroable};

use crate::headless;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A stamp, as `Stamp` in `quads.wgsl` gets it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Instance {
    /// Clip space.
    center: [f32; 2],
    radius: [f32; 2],
    /// Bytes of RGBA.
    diffuse: u32,
    specular: u32,
    /// Slope at the rim, opacity.
    bump: [f32; 2],
}

const ATTRIBUTES: [wgpu::VertexAttribute; 5] =
    wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32x2, 2 => Unorm8x4, 3 => Unorm8x4, 4 => Float32x2];

impl Instance {
    /// `to_clip`: from 1/256 texel to clip space, whose side is 2.
    fn new(splat: &Splat, to_clip: f32) -> Self {
        let [u, v] = splat.center.map(|along| along as f32 * to_clip - 1.0);
        Self {
            center: [u, -v],
            radius: splat.radius.map(|along| along as f32 * to_clip),
            diffuse: splat.diffuse,
            specular: splat.specular,
            bump: [splat.bump as f32, splat.bump_opacity as f32],
        }
    }
}

/// The three maps, and what draws into them.
pub struct Quads {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::RenderPipeline,
    size: u32,
    maps: [wgpu::Texture; 3],
    views: [wgpu::TextureView; 3],
    rows: Vec<Instance>,
    instances: wgpu::Buffer,
}

impl Quads {
    /// Maps of `size` texels along each side, for at most `most` stamps at a time.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, size: u32, most: usize) -> Self {
        let instances = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stamps"),
            size: (most * size_of::<Instance>()) as u64,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let maps = maps(device, size);
        Self {
            device: device.clone(),
            queue: queue.clone(),
            pipeline: pipeline(device),
            size,
            views: views(&maps),
            maps,
            rows: Vec::with_capacity(most),
            instances,
        }
    }

    /// Puts maps that nothing has been painted on in the place of these.
    pub fn renew(&mut self) {
        self.maps = maps(&self.device, self.size);
        self.views = views(&self.maps);
    }

    /// All stamps in one draw. Returns how many.
    pub fn instanced(&mut self, splats: &[Splat]) -> usize {
        self.paint(splats, |pass, count| pass.draw(0..4, 0..count))
    }

    /// One draw for each stamp. Returns how many.
    pub fn one_by_one(&mut self, splats: &[Splat]) -> usize {
        self.paint(splats, |pass, count| {
            (0..count).for_each(|number| pass.draw(0..4, number..number + 1));
        })
    }

    /// Packs, uploads and draws, until the GPU is done.
    fn paint(&mut self, splats: &[Splat], draw: impl Fn(&mut wgpu::RenderPass<'_>, u32)) -> usize {
        let to_clip = 2.0 / (256 * self.size) as f32;
        self.rows.clear();
        self.rows.extend(splats.iter().map(|splat| Instance::new(splat, to_clip)));
        self.queue.write_buffer(&self.instances, 0, bytemuck::cast_slice(&self.rows));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let attachments = self.views.each_ref().map(|view| {
                Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    // Marks stay, as they do in the library's maps.
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })
            });
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("quads"),
                color_attachments: &attachments,
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_vertex_buffer(0, self.instances.slice(..));
            draw(&mut pass, self.rows.len() as u32);
        }
        self.queue.submit([encoder.finish()]);
        headless::wait(&self.device);
        self.rows.len()
    }

    /// Bytes of the diffuse, the specular and the normal map.
    pub fn read(&self) -> [Vec<u8>; 3] {
        self.maps.each_ref().map(|map| headless::read_texture(&self.device, &self.queue, map))
    }
}

fn maps(device: &wgpu::Device, size: u32) -> [wgpu::Texture; 3] {
    ["diffuse", "specular", "normal"].map(|label| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    })
}

fn views(maps: &[wgpu::Texture; 3]) -> [wgpu::TextureView; 3] {
    maps.each_ref().map(|map| map.create_view(&wgpu::TextureViewDescriptor::default()))
}

fn pipeline(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("quads"),
        source: wgpu::ShaderSource::Wgsl(include_str!("quads.wgsl").into()),
    });
    let target = wgpu::ColorTargetState {
        format: FORMAT,
        blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        write_mask: wgpu::ColorWrites::ALL,
    };
    let targets = [Some(target.clone()), Some(target.clone()), Some(target)];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("quads"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[wgpu::VertexBufferLayout {
                array_stride: size_of::<Instance>() as u64,
                step_mode: wgpu::VertexStepMode::Instance,
                attributes: &ATTRIBUTES,
            }],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..Default::default()
        },
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
