//! Recording what somebody does in a running scene, as a scenario that comes out the same.
//!
//! A session is a run of a scenario ([`prepare`]) to which events are added while it runs. Between ticks everything that may be
//! changed is compared with what events have made of it (`watch`): the weather, what surfaces are made of, emitters, where they
//! are and whether they are on, brush strokes that wait; emitters may come and go (`emitters`). What was changed is taken back
//! and becomes an event of the tick that comes next, in which the code acts that acts in a replay. So whoever changes it, and by
//! whatever way, it acts as it will act again, and the [`Digest`](crate::scenario::Digest) of the session is that of a replay of
//! what is written down.
//!
//! What cannot be said by an event is either taken back and told ([`Recording::take_notes`]), such as another place of the sun, or
//! stays and is a *flaw* ([`Recording::flaws`]), which the file names and every replay of it tells: effects that are edited,
//! surfaces and emitters that are no scenario's. Emission has full detail while a session is recorded, however slow the machine;
//! time slows down instead.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_weathering::record::{Beginning, RecordError, begin, prepare, save};
//! # use bevy_weathering::scenario::{LoadedScenario, PreparedScenario, switch_scenario};
//! # fn start(world: &mut World, open: &LoadedScenario) -> Result<(), RecordError> {
//! // As it is set now, in a folder of its own, from which it is started over.
//! let beginning = Beginning::of(world);
//! let base = prepare(open, beginning, "recorded".as_ref())?;
//! let prepared = PreparedScenario::new(base.clone(), true)?;
//! switch_scenario(world, prepared);
//! begin(world, base);
//! # Ok(()) }
//! # fn later(world: &mut World) -> Result<(), RecordError> {
//! // When something has been done:
//! let file = save(world)?;
//! info!("weathering replay {}", file.display());
//! # Ok(()) }
//! ```
//!
//! # Going back
//! Moments are kept as the session goes on (`history`), and any second can be gone back to ([`go_to`]): the moment before it is put
//! back, and ticks run from there on by what was recorded. Then what was done after it happens again, until somebody does
//! something else: that is a branch, and what came after in the old one is written into a file of its own. A stroke of a brush is
//! taken back ([`take_back_stroke`]) in the same way, by a run without it.
//!
//! Not here: models that were opened without a scenario, surfaces that are posed from elsewhere.

mod actions;
mod base;
mod emitters;
mod error;
mod file;
mod history;
mod rewind;
mod session;
mod watch;
mod watched_emitter;

use bevy::prelude::*;

use crate::clock::advance_clock;
use crate::effect::WeatherEffect;
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::weather::advance_drying_clock;

pub use base::{Beginning, ExtraEmitter, prepare};
pub use error::RecordError;
pub use rewind::{colors_at_hand, go_to, keep_moment, put_back, take_back_stroke};
pub use session::{Recording, begin, end, save};

/// Records, once somebody [`begin`]s. Add it after [`WeatheringPlugins`](crate::WeatheringPlugins) and
/// [`ScenarioPlugin`](crate::scenario::ScenarioPlugin).
pub struct RecordPlugin;

impl Plugin for RecordPlugin {
    fn build(&self, app: &mut App) {
        // Before anything of the frame sees what the last one has changed.
        app.add_systems(First, session::between_ticks.run_if(resource_exists::<Recording>))
            .add_systems(Last, watch_effects)
            .add_systems(
                WeatheringTick,
                (
                    session::begin_tick
                        .run_if(resource_exists::<Recording>)
                        // It has to know which tick acts, and what dries in it is by the weather of events.
                        .after(advance_clock)
                        .before(advance_drying_clock),
                    // What the whole tick has made of it.
                    session::end_tick.run_if(resource_exists::<Recording>).after(WeatheringSystems::Last),
                ),
            );
    }
}

/// Effects are files; what is edited in them no event can say.
fn watch_effects(
    mut events: MessageReader<AssetEvent<WeatherEffect>>,
    mut recording: Option<ResMut<Recording>>,
) {
    for event in events.read() {
        if let (AssetEvent::Modified { id }, Some(recording)) = (event, recording.as_mut())
            && recording.uses(*id)
        {
            recording.add_flaw("an effect was edited");
        }
    }
}
