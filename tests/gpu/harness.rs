//! Runs a compute shader on the machine's GPU or software driver, so that a test sees the real WGSL.
//!
//! [`compose`] joins shader modules the way the engine does, [`run_compute`] maps an array of inputs to an
//! array of outputs of the same length. All tests share one device.

use std::borrow::Cow;
use std::sync::{OnceLock, mpsc};

use bevy::tasks::block_on;
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// A device and its queue; clones are handles to the same device.
#[derive(Debug, Clone)]
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

/// The device that all tests share, or `None` if `WEATHERING_SKIP_GPU=1`, which it then prints.
///
/// # Panics
///
/// If there is no adapter or it refuses a device: a run that tested nothing must not pass for a success.
pub fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    if crate::common::skips_gpu() {
        return None;
    }
    Some(GPU.get_or_init(open_gpu).clone())
}

fn open_gpu() -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter =
        block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap_or_else(|error| {
            panic!(
                "no GPU adapter: {error}. Install a Vulkan driver, for example the software driver in the \
                 Debian package mesa-vulkan-drivers, or set WEATHERING_SKIP_GPU=1 to skip GPU tests."
            )
        });
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("weathering tests"),
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let (device, queue) = block_on(adapter.request_device(&descriptor))
        .unwrap_or_else(|error| panic!("adapter {:?} gave no device: {error}", adapter.get_info().name));
    Gpu { device, queue }
}

/// Joins the importable modules `sources`, given as path and text with imported modules first, and the text
/// of the top-level shader `entry` into one validated module.
///
/// # Panics
///
/// On any error, with the composer's report that quotes the faulty line.
pub fn compose(sources: &[(&str, &str)], entry: &str) -> naga::Module {
    let mut composer = Composer::default();
    for &(path, source) in sources {
        let descriptor = ComposableModuleDescriptor { source, file_path: path, ..Default::default() };
        if let Some(error) = composer.add_composable_module(descriptor).err() {
            panic!("{}", error.emit_to_string(&composer));
        }
    }
    let descriptor =
        NagaModuleDescriptor { source: entry, file_path: "test entry point", ..Default::default() };
    composer
        .make_naga_module(descriptor)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&composer)))
}

/// Runs the only compute entry point of `module` once per element of `inputs`; returns one output for each.
///
/// The shader finds `inputs` as a read-only storage array in group 0, binding 0, and writes a storage array
/// in group 0, binding 1, both indexed by `global_invocation_id.x`. `workgroup_size` repeats the shader's
/// `@workgroup_size`; invocations beyond the end of the arrays must return.
pub fn run_compute<I: bytemuck::Pod, O: bytemuck::Pod>(
    gpu: &Gpu,
    module: naga::Module,
    inputs: &[I],
    workgroup_size: u32,
) -> Vec<O> {
    assert!(!inputs.is_empty(), "an empty storage buffer cannot be bound");
    let Gpu { device, queue } = gpu;
    let output_size = (inputs.len() * size_of::<O>()) as u64;

    let input = device.create_buffer_init(&BufferInitDescriptor {
        label: Some("inputs"),
        contents: bytemuck::cast_slice(inputs),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let output = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("outputs"),
        size: output_size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let readback = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size: output_size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });

    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("shader under test"),
        source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("shader under test"),
        layout: None,
        module: &shader,
        entry_point: None,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("inputs and outputs"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: input.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: output.as_entire_binding() },
        ],
    });

    let workgroups = u32::try_from(inputs.len()).expect("test arrays are short").div_ceil(workgroup_size);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(workgroups, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&output, 0, &readback, 0, output_size);
    queue.submit([encoder.finish()]);

    let (sender, receiver) = mpsc::channel();
    readback.map_async(wgpu::MapMode::Read, .., move |result| {
        sender.send(result).expect("the receiver lives until the callback has run");
    });
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes its queue");
    receiver.recv().expect("polling runs the callback").expect("the readback buffer can be mapped");
    let bytes = readback.get_mapped_range(..);
    bytes.chunks_exact(size_of::<O>()).map(bytemuck::pod_read_unaligned).collect()
}
