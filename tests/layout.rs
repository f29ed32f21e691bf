//! Structs that Rust and WGSL share: same names, same order, same offsets, same scalars.
//!
//! The shaders import each other with directives that naga does not know, so structs and flags are cut out of
//! their file and parsed by themselves; the shared ones hold nothing but scalars and vectors.

use std::mem::offset_of;

use bevy::math::{UVec2, Vec3};
use bevy::render::render_resource::{ShaderType, encase::UniformBuffer};
use bevy_weathering::material::{GpuDryingPoint, PorousUniform};
use bevy_weathering::matter::GpuTexelMatter;
use bevy_weathering::overlay::{MipStep, RainRing, SurfaceBatch, TexelFrame, TileHeader};
use bevy_weathering::particle::{GpuLook, GpuParticle};
use bevy_weathering::stamps::StampTexel;
use bevy_weathering::wetting::gpu::GpuTexelWater;
use naga::{Expression, Literal, Module, ScalarKind, TypeInner};

const SPLAT: &str = include_str!("../shaders/splat.wgsl");
const MIPS: &str = include_str!("../shaders/mips.wgsl");
const STAMP: &str = include_str!("../shaders/common/stamp.wgsl");
const MATTER: &str = include_str!("../shaders/common/matter.wgsl");
const PARTICLES: &str = include_str!("../shaders/particles.wgsl");
const WET_MAP: &str = include_str!("../shaders/common/wet_map.wgsl");

#[derive(Debug, PartialEq)]
struct Layout {
    fields: Vec<Field>,
    /// Bytes from one row of an array to the next.
    size: u32,
}

#[derive(Debug, PartialEq)]
struct Field {
    name: String,
    offset: u32,
    size: u32,
    kind: ScalarKind,
}

/// The structs and flags of a shader.
fn parse(source: &str) -> Module {
    let mut cut = String::new();
    let mut inside = false;
    for line in source.lines() {
        inside |= line.starts_with("struct ");
        if inside || line.starts_with("const FLAG_") {
            cut += line;
            cut += "\n";
        }
        inside &= line != "}";
    }
    naga::front::wgsl::parse_str(&cut).expect("the structs need nothing that is imported")
}

/// The layout of a struct by the rules of WGSL.
fn wgsl_layout(source: &str, name: &str) -> Layout {
    let module = parse(source);
    let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
    let (_, found) = found.expect("the shader has the struct");
    let TypeInner::Struct { members, span } = &found.inner else { unreachable!("cut out as a struct") };
    let fields = members.iter().map(|member| {
        let inner = &module.types[member.ty].inner;
        let parts = match inner {
            TypeInner::Array { base, .. } => &module.types[*base].inner,
            other => other,
        };
        Field {
            name: member.name.clone().expect("fields have names"),
            offset: member.offset,
            size: inner.size(module.to_ctx()),
            kind: parts.scalar_kind().expect("fields are scalars, and vectors and arrays of them"),
        }
    });
    Layout { fields: fields.collect(), size: *span }
}

/// What a field is made of.
trait Words {
    const KIND: ScalarKind;
}

impl Words for u32 {
    const KIND: ScalarKind = ScalarKind::Uint;
}

impl Words for i32 {
    const KIND: ScalarKind = ScalarKind::Sint;
}

impl Words for f32 {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl<T: Words, const N: usize> Words for [T; N] {
    const KIND: ScalarKind = T::KIND;
}

fn rust_field<R, F: Words>(name: &str, offset: usize, _: fn(&R) -> &F) -> Field {
    Field { name: name.into(), offset: offset as u32, size: size_of::<F>() as u32, kind: F::KIND }
}

/// The layout of a `repr(C)` struct. Does not compile when a field is missing.
macro_rules! rust_layout {
    ($row:ident { $($field:ident),* }) => {{
        let _ = |$row { $($field: _),* }: $row| ();
        Layout {
            fields: vec![
                $(rust_field(stringify!($field), offset_of!($row, $field), |row: &$row| &row.$field)),*
            ],
            size: size_of::<$row>() as u32,
        }
    }};
}

#[test]
fn a_texels_frame_and_a_stamps_texel_are_the_same_rows_on_both_sides() {
    assert_eq!(wgsl_layout(SPLAT, "TexelFrame"), rust_layout!(TexelFrame { xy, z, normal, along_u }));
    let stamp = rust_layout!(StampTexel { diffuse, specular, normal, pad });
    assert_eq!(wgsl_layout(STAMP, "StampTexel"), stamp);
}

#[test]
fn the_matter_of_a_texel_is_the_same_row_on_both_sides() {
    assert_eq!(wgsl_layout(MATTER, "TexelMatter"), rust_layout!(GpuTexelMatter { dust_mud, snow }));
}

#[test]
fn a_particle_and_a_look_are_the_same_rows_on_both_sides() {
    let particle = rust_layout!(GpuParticle { position, kind, velocity, size_age });
    assert_eq!(wgsl_layout(PARTICLES, "Particle"), particle);
    assert_eq!(wgsl_layout(PARTICLES, "Look"), rust_layout!(GpuLook { color, exposure, spin, pad }));
}

#[test]
fn a_tile_is_the_same_row_on_both_sides() {
    assert_eq!(wgsl_layout(SPLAT, "TileHeader"), rust_layout!(TileHeader { x, y, start, count }));
}

#[test]
fn a_texel_is_the_same_row_for_the_painter_and_for_the_material() {
    let rust = rust_layout!(GpuTexelWater { amounts, tick, bytes, marks });
    assert_eq!(wgsl_layout(WET_MAP, "TexelWater"), rust);
}

#[test]
fn a_drying_point_is_the_same_row_on_both_sides() {
    let rust = rust_layout!(GpuDryingPoint { tick, air_mm, sun_mm, air_per_tick, sun_per_tick });
    assert_eq!(wgsl_layout(WET_MAP, "DryingPoint"), rust);
}

#[test]
fn a_ring_is_the_same_row_for_the_painter_and_for_the_material() {
    let rust = rust_layout!(RainRing { center, tick, water_nl });
    assert_eq!(wgsl_layout(SPLAT, "RainRing"), rust);
    assert_eq!(wgsl_layout(WET_MAP, "RainRing"), rust);
}

/// The Rust side writes four words, then the points.
#[test]
fn the_clock_is_four_words_and_its_points() {
    let module = parse(WET_MAP);
    let (_, clock) =
        module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Clock")).expect("the shader has it");
    let TypeInner::Struct { members, .. } = &clock.inner else { unreachable!("cut out as a struct") };
    let fields: Vec<_> =
        members.iter().map(|member| (member.name.as_deref().unwrap(), member.offset)).collect();
    assert_eq!(fields, [("tick", 0), ("hz", 4), ("count", 8), ("pad", 12), ("points", 16)]);
    let TypeInner::Array { stride, .. } = module.types[members[4].ty].inner else {
        unreachable!("points are an array")
    };
    assert_eq!(stride as usize, size_of::<GpuDryingPoint>());
}

/// `PorousUniform` has no layout of its own: encase writes it. So its bytes are looked at.
#[test]
fn the_constants_of_a_surface_are_read_as_they_are_written() {
    let written = PorousUniform {
        wet_color: Vec3::new(1.0, 2.0, 3.0),
        wet_roughness: 4.0,
        absorption_per_mm: Vec3::new(5.0, 6.0, 7.0),
        wet_reflectance: 8.0,
        flood: Vec3::new(9.0, 10.0, 11.0),
        levelling_mm: 12.0,
        porosity: 13.0,
        s_p: 14.0,
        m: 15.0,
        k_s: 16.0,
        k_w: 17.0,
        film_p: 18.0,
        film_x: 19.0,
        backscatter: 20.0,
        t_fill: 21.0,
        capacity_mm: 22.0,
        visible_mm: 23.0,
        sorptivity_squared: 24.0,
        reserve_mm: 25.0,
        efflorescence: 26.0,
        tide_mark: 27.0,
        map_ticks: 28.0,
        map_fill: 29.0,
        map_tick: 30,
        wet_translucency: 31.0,
        rain_mm_per_h: 32.0,
        ripple_cell: 33.0,
        size: 34,
        flags: 35,
    };
    let floats = |values: &[f32]| (ScalarKind::Float, values.iter().map(|value| value.to_bits()).collect());
    let expected: Vec<(&str, (ScalarKind, Vec<u32>))> = vec![
        ("wet_color", floats(&[1.0, 2.0, 3.0])),
        ("wet_roughness", floats(&[4.0])),
        ("absorption_per_mm", floats(&[5.0, 6.0, 7.0])),
        ("wet_reflectance", floats(&[8.0])),
        ("flood", floats(&[9.0, 10.0, 11.0])),
        ("levelling_mm", floats(&[12.0])),
        ("porosity", floats(&[13.0])),
        ("s_p", floats(&[14.0])),
        ("m", floats(&[15.0])),
        ("k_s", floats(&[16.0])),
        ("k_w", floats(&[17.0])),
        ("film_p", floats(&[18.0])),
        ("film_x", floats(&[19.0])),
        ("backscatter", floats(&[20.0])),
        ("t_fill", floats(&[21.0])),
        ("capacity_mm", floats(&[22.0])),
        ("visible_mm", floats(&[23.0])),
        ("sorptivity_squared", floats(&[24.0])),
        ("reserve_mm", floats(&[25.0])),
        ("efflorescence", floats(&[26.0])),
        ("tide_mark", floats(&[27.0])),
        ("map_ticks", floats(&[28.0])),
        ("map_fill", floats(&[29.0])),
        ("map_tick", (ScalarKind::Uint, vec![30])),
        ("wet_translucency", floats(&[31.0])),
        ("rain_mm_per_h", floats(&[32.0])),
        ("ripple_cell", floats(&[33.0])),
        ("size", (ScalarKind::Uint, vec![34])),
        ("flags", (ScalarKind::Uint, vec![35])),
    ];
    let mut buffer = UniformBuffer::new(Vec::new());
    buffer.write(&written).unwrap();
    let bytes = buffer.into_inner();

    let Layout { fields, size } = wgsl_layout(WET_MAP, "PorousUniform");
    let read = fields.iter().map(|field| {
        let words = bytes[field.offset as usize..][..field.size as usize].chunks_exact(4);
        let words = words.map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        (field.name.as_str(), (field.kind, words))
    });
    assert_eq!(read.collect::<Vec<_>>(), expected);
    assert_eq!(u64::from(size), PorousUniform::min_size().get());
}

#[test]
fn flags_are_the_same_bits_on_both_sides() {
    let module = parse(WET_MAP);
    let in_shader = module.constants.iter().map(|(_, constant)| {
        let Expression::Literal(Literal::U32(bit)) = module.global_expressions[constant.init] else {
            panic!("{constant:?} is not a plain u32")
        };
        (constant.name.as_deref().unwrap(), bit)
    });
    let in_rust = [
        ("FLAG_SQRT_K", PorousUniform::FLAG_SQRT_K),
        ("FLAG_SOLID", PorousUniform::FLAG_SOLID),
        ("FLAG_BLINN_PHONG", PorousUniform::FLAG_BLINN_PHONG),
        ("FLAG_CLAMP_U", PorousUniform::FLAG_CLAMP_U),
        ("FLAG_CLAMP_V", PorousUniform::FLAG_CLAMP_V),
        ("FLAG_ACCUMULATION", PorousUniform::FLAG_ACCUMULATION),
        ("FLAG_LEVEL", PorousUniform::FLAG_LEVEL),
        ("FLAG_POROSITY_TEXTURE", PorousUniform::FLAG_POROSITY_TEXTURE),
        ("FLAG_POROSITY_GLOSS", PorousUniform::FLAG_POROSITY_GLOSS),
        ("FLAG_METALNESS_FROM_SPECULAR", PorousUniform::FLAG_METALNESS_FROM_SPECULAR),
        ("FLAG_MAP_DRIES", PorousUniform::FLAG_MAP_DRIES),
    ];
    assert_eq!(in_shader.collect::<Vec<_>>(), in_rust);
}

#[test]
fn texels_beside_the_mesh_are_marked_alike_on_both_sides() {
    let line = format!("const BESIDE: u32 = {:#x}u;", GpuTexelWater::BESIDE);
    assert!(WET_MAP.lines().any(|other| other == line), "{line}");
}

/// `SurfaceBatch` is written by encase, too.
#[test]
fn a_batch_is_read_as_it_is_written() {
    let written = SurfaceBatch { size: 1, first_tile: 2, tiles: 3, clamped: UVec2::new(4, 5) };
    let mut buffer = UniformBuffer::new(Vec::<u8>::new());
    buffer.write(&written).expect("a vector holds anything");
    let words: &[u32] = bytemuck::cast_slice(buffer.as_ref());
    // Before two numbers together there is a gap.
    assert_eq!(words, [1, 2, 3, 0, 4, 5]);
    let Layout { fields, size } = wgsl_layout(SPLAT, "SurfaceBatch");
    let read: Vec<_> = fields.iter().map(|field| (field.name.as_str(), field.offset)).collect();
    assert_eq!(read, [("size", 0), ("first_tile", 4), ("tiles", 8), ("clamped", 16)]);
    assert_eq!(u64::from(size), SurfaceBatch::min_size().get());
}

#[test]
fn a_mip_step_is_read_as_it_is_written() {
    let written = MipStep { size: 1, first_tile: 2, first_word: 3, masked: 4 };
    let mut buffer = UniformBuffer::new(Vec::<u8>::new());
    buffer.write(&written).expect("a vector holds anything");
    let words: &[u32] = bytemuck::cast_slice(buffer.as_ref());
    assert_eq!(words, [1, 2, 3, 4]);
    let Layout { fields, size } = wgsl_layout(MIPS, "MipStep");
    let read: Vec<_> = fields.iter().map(|field| (field.name.as_str(), field.offset)).collect();
    assert_eq!(read, [("size", 0), ("first_tile", 4), ("first_word", 8), ("masked", 12)]);
    assert_eq!(u64::from(size), MipStep::min_size().get());
}
