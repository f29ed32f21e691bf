//! Folders of saved scenes.

use std::fs;
use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::{Emitter, EmitterShape};
use bevy_weathering::record::colors_at_hand;
use bevy_weathering::save::{AddedEmitter, SavedScene};
use bevy_weathering::scenario::{ByHand, Scenario};
use tempfile::TempDir;

use super::super::record::ready;
use super::harness::fuzz;
use super::scenarios::{SMALL, tree};
use super::{mutate, run, write};

/// Puts a file back as it was, also if what was done with it panicked.
struct PutBack<'a>(&'a Path, &'a [u8]);

impl Drop for PutBack<'_> {
    fn drop(&mut self) {
        write(self.0, self.1);
    }
}

/// A small scene, saved after so many ticks, with an emitter in somebody's hand, an effect that was edited, and an emitter that was
/// added: the folder of all, the scenario's file, and the folder of what was saved.
fn kept_after(ticks: u32) -> (TempDir, PathBuf, PathBuf) {
    let tree = tree();
    let scene = tree.path().join("scenarios/scene.ron");
    write(&scene, SMALL);
    let kept = tree.path().join("kept");
    let scenario = Scenario::load(&scene).expect("it is whole");
    let mut app = ready(scenario.clone());
    let world = app.world_mut();
    let mut emitters = world.query::<(Entity, &Emitter)>();
    let (first, effect) = emitters
        .iter(world)
        .find(|(_, emitter)| emitter.stream == 0)
        .map(|(entity, emitter)| (entity, emitter.effect.clone()))
        .expect("it has emitters");
    let above = Transform::from_xyz(0.0, 1.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::X);
    world.entity_mut(first).insert((ByHand, above, GlobalTransform::from(above)));
    world.get_mut::<Emitter>(first).expect("it is one").enabled = true;
    let mut effects = world.resource_mut::<Assets<WeatherEffect>>();
    effects.get_mut(&effect).expect("it is there").volume_mm3 = 21.5;
    let effect = effects.add(WeatherEffect { volume_mm3: 5.0, ..default() });
    let shape = EmitterShape::Disc { radius: 0.1 };
    let added = Emitter { effect, shape, rate: 30.0, speed: 1.0, stream: 1 << 29, ..default() };
    let place = Transform::from_xyz(0.1, 0.5, 0.0).looking_to(Vec3::NEG_Y, Vec3::X);
    world.spawn((AddedEmitter, Name::new("added"), added, place, GlobalTransform::from(place)));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    (0..ticks).for_each(|_| app.update());
    let world = app.world_mut();
    let colors = colors_at_hand(world).expect("nothing is on a GPU");
    let saved = SavedScene::capture(world, &scenario, colors).with_emitters(world).expect("all is there");
    saved.write(&kept).expect("it can be written");
    (tree, scene, kept)
}

#[test]
fn spoilt_states_are_restored_or_refused() {
    let (tree, scene, kept) = kept_after(10);
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for entry in fs::read_dir(&kept).expect("it was saved") {
        let file = entry.expect("it can be read").path();
        let bytes = fs::read(&file).expect("it can be read");
        files.push((file, bytes));
    }
    files.sort();
    let state = files.iter().position(|(file, _)| file.ends_with("state.ron")).expect("it was saved");
    let text = String::from_utf8(files[state].1.clone()).expect("it is text");
    assert!(files.len() > 10 && text.contains("particles"), "{} files", files.len());
    assert!(["role: ByHand", "role: Added", "edited: ["].iter().all(|part| text.contains(part)), "{text}");

    let tally = fuzz("states", 1000, move |_, random| {
        let _ = &tree;
        let (file, whole) = if random.below(3) > 0 { &files[state] } else { mutate::pick(random, &files) };
        let spoilt = if file.ends_with("state.ron") {
            mutate::text(random, &text, &[])
        } else {
            mutate::png(random, whole)
        };
        write(file, spoilt);
        let _put_back = PutBack(file, whole);
        let read = SavedScene::read(&kept).map_err(|error| {
            let message = error.to_string();
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            // Or a map that another state would have.
            assert!(message.contains(&*name) || message.contains(".png"), "no file is named: {message}");
            message
        });
        read.and_then(|saved| {
            // So few ticks that any test machine has the time for them.
            if random.below(10) == 0 && saved.tick() <= 40 {
                let scenario = Scenario::load(&scene).map_err(|error| error.to_string())?;
                run(scenario, saved.tick() as f32 / 20.0 + 0.2, Some(kept.clone()))?;
            }
            Ok(())
        })
    });
    assert!(tally.accepted > 20 && tally.refused > 200, "{tally:?}");
}

#[test]
#[cfg(unix)]
fn links_and_pipes_in_a_saved_scene_are_refused() {
    let (tree, _, kept) = kept_after(2);
    let tally = fuzz("links in states", 4, move |number, _| {
        let file = kept.join(["state.ron", "floor_diffuse.png"][number % 2]);
        let elsewhere = tree.path().join(format!("elsewhere{number}"));
        fs::rename(&file, &elsewhere).expect("it can be moved");
        if number < 2 {
            std::os::unix::fs::symlink(&elsewhere, &file).expect("a new link");
        } else {
            let made = std::process::Command::new("mkfifo").arg(&file).status().expect("mkfifo runs");
            assert!(made.success());
        }
        let refused = SavedScene::read(&kept).map(drop).map_err(|error| error.to_string());
        fs::remove_file(&file).expect("it can be removed");
        fs::rename(&elsewhere, &file).expect("it can be moved back");
        refused
    });
    assert_eq!(tally.refused, 4, "{tally:?}");
}
