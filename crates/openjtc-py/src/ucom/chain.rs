//! Chain of boards for Python; the methods call the thread that owns the session of the chain.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use host_kit::owner::Kind;
use host_kit::user_folder;
use pyo3::prelude::*;
use serde_json::Value;
use ucom_host::files::{Inventory, SignalTable};
use ucom_host::master::StopLevel;
use ucom_host::master::io::Kind as Buffer;
use ucom_host::master::probe::ProbeOptions;
use ucom_host::session::{Assignment, Boards, Cache, Link, ParameterFile, SessionError};

use super::owner::Owner;
use super::recording::{ChainRecording, Sink, Tap};
use super::samples::ChainSamples;
use super::shared::{Halt, Listener};
use super::simulated::{Simulated, SimulatedChain};
use super::update::{Read, Source, Update};
use super::worker_state::Config;
use super::{procedures, running, update, values};
use crate::error::Failure;
use crate::json;

type Object<'py> = PyResult<Bound<'py, PyAny>>;
/// Board number, name and value as Python passes them.
type Given = (Option<u8>, String, String);

/// Date as year, month and day.
type Day = (u16, u8, u8);

/// Chain of boards on a bus.
#[pyclass(frozen, module = "openjtc._native")]
pub(super) struct Chain {
    pub owner: Owner,
    url: String,
    profile: ucom::Profile,
    inventory_file: Option<PathBuf>,
    sink: Sink,
}

fn boards(text: &str) -> Result<Boards, Failure> {
    text.parse().map_err(Failure::usage)
}

fn assignments(values: Vec<Given>) -> Result<Vec<Assignment>, Failure> {
    let one = |(board, name, value): Given| {
        let value = value.parse().map_err(|e| Failure::usage(format!("{name}: {e}")))?;
        Ok(Assignment { board, name, value })
    };
    values.into_iter().map(one).collect()
}

impl Chain {
    /// Reads a parameter file. The calling thread does this, because the thread of the session must not wait for a disk.
    fn parameter_file(&self, py: Python<'_>, path: &Path) -> Result<ParameterFile, Failure> {
        let inventory = self.inventory_file.clone().unwrap_or_default();
        Ok(py.detach(|| ParameterFile::read(path, &inventory, |_| true)).map_err(SessionError::from)?)
    }
}

fn plain(py: Python<'_>, value: Value) -> Object<'_> {
    json::to_python(py, &value)
}

#[pymethods]
impl Chain {
    #[new]
    #[pyo3(signature = (url, simulated=None, profile=None, on_lost=None, signals=None, inventory=None, cache=None, remember=true, deadline_s=None))]
    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn new(
        py: Python<'_>,
        url: String,
        simulated: Option<Py<SimulatedChain>>,
        profile: Option<PathBuf>,
        on_lost: Option<&str>,
        signals: Option<PathBuf>,
        inventory: Option<PathBuf>,
        cache: Option<PathBuf>,
        remember: bool,
        deadline_s: Option<f64>,
    ) -> Result<Self, Failure> {
        let deadline = deadline_s.map(|s| match Duration::try_from_secs_f64(s) {
            Ok(deadline) if !deadline.is_zero() => Ok(deadline),
            _ => {
                Err(Failure::usage(format!("deadline_s: {s} s is not a valid time, expected more than 0 s")))
            }
        });
        let profile = procedures::profile(profile.as_deref(), on_lost)?;
        let signals = signals.map(|path| SignalTable::read(&path)).transpose();
        let signals =
            signals.map_err(|e| Failure::usage(e.to_string()).next("ucom help edges shows the format"))?;
        let listed = inventory.as_deref().filter(|path| path.exists()).map(Inventory::read).transpose();
        let simulated: Option<Arc<Simulated>> = simulated.map(|chain| chain.get().inner.clone());
        let folder = || Some(user_folder("XDG_CACHE_HOME", ".cache")?.join("ucom"));
        let cache = cache.or_else(folder).filter(|_| remember);
        let config = Config {
            profile,
            signals: signals.unwrap_or_default(),
            cache: Cache::new(cache, false),
            inventory: listed.map_err(|e| Failure::usage(e.to_string()))?,
            inventory_file: inventory.clone(),
            deadline: deadline.transpose()?,
            simulated,
        };
        let sink = Sink::default();
        let (own, opened) = (sink.clone(), url.clone());
        let link = py.detach(|| {
            let bus = can_link::open(&opened).map_err(|e| SessionError::Open(Box::new(e)))?;
            Ok::<_, SessionError>(Link::on(Box::new(Tap::new(bus, own)), &opened))
        })?;
        Ok(Self { owner: Owner::new(config, link), url, profile, inventory_file: inventory, sink })
    }

    #[getter]
    fn url(&self) -> &str {
        &self.url
    }

    /// Returns the load of the bus, the frame counts and the time of this state.
    fn bus<'py>(&self, py: Python<'py>) -> Object<'py> {
        plain(py, self.owner.shared.bus())
    }

    fn events<'py>(&self, py: Python<'py>, after: u64) -> Object<'py> {
        plain(py, self.owner.shared.events(after))
    }

    fn check(&self) -> Result<(), Failure> {
        self.owner.shared.check()
    }

    fn close(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        self.owner.close(py)
    }

    fn scan<'py>(&self, py: Python<'py>) -> Object<'py> {
        plain(py, self.owner.call(py, procedures::scan)?)
    }

    fn init<'py>(&self, py: Python<'py>, renew: bool, force: bool, check: bool) -> Object<'py> {
        let after = self.owner.now()?;
        let file = self.inventory_file.as_deref();
        // The calling thread reads the file, because the thread of the session must not wait for a disk.
        let read = py.detach(|| file.filter(|file| file.exists()).map(Inventory::read).transpose());
        let listed = read.map_err(|e| Failure::usage(e.to_string()))?;
        let init = move |state: &mut _| procedures::init(state, listed, (renew, force, check));
        let (value, made) = self.owner.call_after(py, after, init)?;
        if let (Some(file), Some(made)) = (file, made) {
            py.detach(|| made.write(file)).map_err(|e| Failure::usage(e.to_string()))?;
        }
        plain(py, value)
    }

    fn info<'py>(&self, py: Python<'py>, boards: &str) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(py, self.owner.call(py, move |state| procedures::info(state, &boards))?)
    }

    fn status<'py>(
        &self,
        py: Python<'py>,
        boards: &str,
        set: Vec<String>,
        clear: Vec<String>,
        force: bool,
    ) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(
            py,
            self.owner.call(py, move |state| procedures::status(state, &boards, (&set, &clear), force))?,
        )
    }

    fn start<'py>(&self, py: Python<'py>, boards: &str, force: bool) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(py, self.owner.call(py, move |state| running::start(state, &boards, force))?)
    }

    fn xreset<'py>(&self, py: Python<'py>, boards: &str, force: bool) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(py, self.owner.call(py, move |state| procedures::xreset(state, &boards, force))?)
    }

    fn reset(&self, py: Python<'_>, boards: &str, force: bool) -> PyResult<Vec<u8>> {
        let boards = self::boards(boards)?;
        self.owner.call(py, move |state| procedures::reset(state, &boards, force))
    }

    fn repair<'py>(&self, py: Python<'py>, board: u8, flash_number: Option<u16>, force: bool) -> Object<'py> {
        plain(py, self.owner.call(py, move |state| procedures::repair(state, board, flash_number, force))?)
    }

    fn stop<'py>(&self, py: Python<'py>, boards: &str, application: bool) -> Object<'py> {
        let boards = self::boards(boards)?;
        let halt = match &boards {
            Boards::All => Halt::All,
            Boards::Some(numbers) => Halt::Boards(numbers.clone()),
            Boards::None => Halt::Boards(Vec::new()),
        };
        let level = if application { StopLevel::Application } else { StopLevel::Loop };
        plain(py, self.owner.stop(py, halt, move |state| running::stop(state, &boards, level))?)
    }

    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        boards: &str,
        active: bool,
        inputs: Vec<Given>,
        parameters: Vec<Given>,
        file: Option<PathBuf>,
        texts: bool,
        force: bool,
    ) -> Object<'py> {
        let after = self.owner.now()?;
        let boards = self::boards(boards)?;
        let (inputs, parameters) = (assignments(inputs)?, assignments(parameters)?);
        let file = file.map(|file| self.parameter_file(py, &file)).transpose()?;
        let run = running::Run { boards, active, inputs, parameters, file, texts, force };
        plain(py, self.owner.call_after(py, after, move |state| running::run(state, run))?)
    }

    fn outputs(&self, py: Python<'_>, boards: &str, active: bool) -> PyResult<()> {
        let boards = self::boards(boards)?;
        self.owner.call(py, move |state| running::outputs(state, &boards, active))
    }

    fn signals<'py>(&self, py: Python<'py>, boards: &str) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(py, self.owner.call(py, move |state| values::signals(state, &boards))?)
    }

    fn initial_inputs<'py>(&self, py: Python<'py>, board: u8) -> Object<'py> {
        plain(py, self.owner.call(py, move |state| values::initial_inputs(state, board))?)
    }

    fn set<'py>(
        &self,
        py: Python<'py>,
        board: u8,
        kind: Option<&str>,
        name: String,
        value: String,
        force: bool,
    ) -> Object<'py> {
        let buffer = match kind {
            None => None,
            Some("input") => Some(Buffer::Ci),
            Some("parameter") => Some(Buffer::Par),
            Some(other) => {
                let text = format!("kind: {other:?} is not valid, expected \"input\" or \"parameter\"");
                return Err(Failure::usage(text).into());
            }
        };
        let set = move |state: &mut _| values::set(state, board, buffer, (&name, &value), force);
        plain(py, self.owner.call(py, set)?)
    }

    fn value<'py>(&self, py: Python<'py>, board: u8, name: String) -> Object<'py> {
        plain(py, self.owner.call(py, move |state| values::value(state, board, &name))?)
    }

    fn values<'py>(&self, py: Python<'py>, boards: &str) -> Object<'py> {
        let boards = self::boards(boards)?;
        plain(py, self.owner.call(py, move |state| values::values(state, &boards))?)
    }

    fn running<'py>(&self, py: Python<'py>) -> Object<'py> {
        plain(py, self.owner.call(py, values::running)?)
    }

    fn parameters_text(&self, py: Python<'_>, boards: &str) -> PyResult<String> {
        let boards = self::boards(boards)?;
        self.owner.call(py, move |state| values::parameters_text(state, &boards))
    }

    fn apply_parameters(&self, py: Python<'_>, path: PathBuf, dry_run: bool, force: bool) -> PyResult<usize> {
        let after = self.owner.now()?;
        let file = self.parameter_file(py, &path)?;
        let apply = move |state: &mut _| values::apply_parameters(state, &file, dry_run, force);
        self.owner.call_after(py, after, apply)
    }

    /// Returns a reader for the samples of boards that arrive after this call.
    fn samples(this: PyRef<'_, Self>, py: Python<'_>, boards: Option<&str>) -> PyResult<ChainSamples> {
        let boards = boards.map(self::boards).transpose()?;
        let listener = this.owner.call(py, move |state| {
            let running: Vec<u8> = state.held.borrow().running().iter().copied().collect();
            let of_all = boards.as_ref().is_none_or(|boards| *boards == Boards::All);
            let numbers = match boards {
                None if !running.is_empty() => running,
                boards => state.driver.numbers(&boards.unwrap_or(Boards::All))?,
            };
            let listener = Arc::new(Listener::new(values::with_names(state, &numbers, of_all)?));
            state.shared.listen(&listener);
            Ok(listener)
        })?;
        Ok(ChainSamples { chain: this.into(), listener })
    }

    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn update<'py>(
        &self,
        py: Python<'py>,
        boards: &str,
        image: (Option<PathBuf>, Option<Vec<u8>>),
        second: (Option<PathBuf>, Option<Vec<u8>>),
        flash_number: Option<u16>,
        date: (Option<Day>, Day),
        addresses: Option<String>,
        expect_program_id: Option<u16>,
        flags: [bool; 10],
        progress: Option<Bound<'py, PyAny>>,
    ) -> Object<'py> {
        let after = self.owner.now()?;
        let source = |(file, bytes): (Option<PathBuf>, Option<Vec<u8>>)| {
            file.map(Source::File).or_else(|| bytes.map(Source::Bytes))
        };
        let [raw, fill_gaps, name_target, group, start, dry_run, unverified, force, rewrite, check] = flags;
        let first = source(image).ok_or_else(|| Failure::usage("the image is missing"))?;
        let (second, profile) = (source(second), &self.profile);
        let any_date = date.0.is_none();
        let read = Read { raw, addresses, fill_gaps, name_target, date: date.0, today: date.1 };
        // The calling thread reads the file, because the thread of the session must not wait for a disk.
        let (image, second, date) = py.detach(|| read.read(&first, second.as_ref(), profile))?;
        let update = Update {
            boards: self::boards(boards)?,
            image,
            second,
            date,
            any_date,
            flash_number,
            expect_program_id,
            name_target,
            group,
            start,
            dry_run,
            unverified,
            force,
            rewrite,
            check,
        };
        let act = move |state: &mut _, report: &dyn Fn(Value)| update::update(state, update, report);
        plain(py, self.owner.call_with(py, (Kind::Update, after), progress.as_ref(), act)?)
    }

    fn doctor<'py>(&self, py: Python<'py>) -> Object<'py> {
        plain(py, self.owner.call(py, procedures::doctor)?)
    }

    fn probe<'py>(
        &self,
        py: Python<'py>,
        init: bool,
        alive: bool,
        image: Option<PathBuf>,
        force: bool,
    ) -> Object<'py> {
        let after = self.owner.now()?;
        let image = py.detach(|| image.as_deref().map(procedures::probed_image).transpose())?;
        let options = ProbeOptions { init, alive, image, force };
        plain(py, self.owner.call_after(py, after, move |state| procedures::probe(state, options))?)
    }

    fn conformance<'py>(
        &self,
        py: Python<'py>,
        boards: &str,
        init: bool,
        run: bool,
        only: Vec<String>,
        force: bool,
    ) -> Object<'py> {
        let boards = self::boards(boards)?;
        let act = move |state: &mut _| procedures::conformance(state, &boards, (init, run, force), only);
        plain(py, self.owner.call(py, act)?)
    }

    fn record(&self, py: Python<'_>, path: PathBuf) -> Result<ChainRecording, Failure> {
        let channel = self.url.rsplit(['/', ':']).next().unwrap_or("can0").to_owned();
        py.detach(|| ChainRecording::begin(self.sink.clone(), &path, self.profile, &channel))
    }
}
