//! Skinned and morphed surfaces, hit where they are.
//!
//! Bevy poses vertices on the GPU, from the mesh, the joints' `GlobalTransform`s and the morph weights. The same is done
//! here on the CPU ([`Deformer`], built together with the mesh's BVH) for those surfaces that can be hit and have moved,
//! and a BVH of their own follows ([`PosedMesh`]). A surface whose joints and weights are what they were costs a
//! comparison. Skinned vertices come out in world space, as in Bevy: the transform of the mesh's entity means nothing.
//!
//! Joints move when Bevy propagates transforms, once a frame in `PostUpdate`. Several ticks in a frame see one pose, that
//! of the frame before, and a surface jumps from pose to pose: what it jumps across is not hit, as with surfaces that
//! move as a whole. So what an animated surface is hit by depends on how ticks fall into frames, unlike all the rest.
//!
//! Marks and water stay where they came to be: they are kept by uv, and uv does not deform. A stamp that comes is carried back
//! to the mesh at rest by the triangle it hit (`overlay/site.rs`); water runs by the slopes of the pose (`wetting/posed.rs`), and
//! drips leave from where the surface is, as fast as its pose moves. Areas of texels and exposure are still those at rest, as
//! the transform of the mesh's entity shows it.
//!
//! A mesh that has joints or morph targets, but is shown by an entity without [`SkinnedMesh`] or [`MeshMorphWeights`], is
//! rigid; so is one with those components, but nothing to apply them to. A triangle without area at rest is never hit.
//!
//! [`SkinnedMesh`]: bevy::mesh::skinning::SkinnedMesh
//! [`MeshMorphWeights`]: bevy::mesh::morph::MeshMorphWeights

mod collider;
mod pose;
mod posed;
mod shape;
mod skin;
#[cfg(test)]
pub(super) mod test_bar;

pub use collider::DeformingCollider;
pub use posed::PosedMesh;
pub use shape::Shape;
pub use skin::Deformer;

pub(super) use collider::attach_deforming;
pub(super) use pose::pose_surfaces;
