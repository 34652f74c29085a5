// SPDX-License-Identifier: Apache-2.0
//! fcsl_zenoh_*: contracts are in fcsl_hal/src/bus/zenoh_session.h.

use std::collections::HashSet;
use std::ffi::{c_char, c_void};
use std::io::Read;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::mpsc::{sync_channel, SyncSender};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh::session::ZenohId;
use zenoh::time::{Timestamp, NTP64};
use zenoh::{Config, Session, Wait};

use crate::c::{self, Reason};

/// In the key of a token: the session's number.
const ZID: &str = "{zid}";

/// Most tokens of one watched key that are told apart; of more, some are not counted.
const TOKENS_MAX: usize = 1024;

#[repr(C)]
#[derive(Clone, Copy)]
pub struct Callbacks {
    ctx: *mut c_void,
    sample: unsafe extern "C" fn(*mut c_void, u32, *const u8, usize),
    stray: unsafe extern "C" fn(*mut c_void),
    matching: unsafe extern "C" fn(*mut c_void, u32, i32),
    tokens: unsafe extern "C" fn(*mut c_void, u32, u32),
    release: unsafe extern "C" fn(*mut c_void),
}

/// What the session and every closure that Zenoh holds share: the last of them releases the context.
struct Events(Callbacks);

// SAFETY: the header says that the functions are called from several threads at a time.
unsafe impl Send for Events {}
// SAFETY: as above.
unsafe impl Sync for Events {}

impl Events {
    fn sample(&self, number: u32, payload: Option<&[u8]>) {
        let (bytes, size) = payload.map_or((std::ptr::null(), 0), |p| (p.as_ptr(), p.len()));
        // SAFETY: the header's contract; the payload lives through the call.
        unsafe { (self.0.sample)(self.0.ctx, number, bytes, size) };
    }

    fn stray(&self) {
        // SAFETY: the header's contract.
        unsafe { (self.0.stray)(self.0.ctx) };
    }

    fn matching(&self, number: u32, matching: bool) {
        // SAFETY: the header's contract.
        unsafe { (self.0.matching)(self.0.ctx, number, i32::from(matching)) };
    }

    fn tokens(&self, number: u32, count: usize) {
        // SAFETY: the header's contract.
        unsafe { (self.0.tokens)(self.0.ctx, number, count as u32) };
    }
}

impl Drop for Events {
    fn drop(&mut self) {
        // SAFETY: the header's contract; nobody else holds the context.
        unsafe { (self.0.release)(self.0.ctx) };
    }
}

/// Queries that wait for their answer. More are dropped: who asked may ask again.
const QUERIES_MAX: usize = 8;

type Reply = Box<dyn FnOnce() + Send>;

/// How long the end of a session waits for replies.
const DRAIN: Duration = Duration::from_millis(200);

/// A thread that replies until all senders are gone. A reply waits for a slow receiver, and Zenoh's own threads, which serve all
/// sessions of the process, must not.
fn start_replier() -> Result<SyncSender<Reply>, std::io::Error> {
    let (sender, replies) = sync_channel::<Reply>(QUERIES_MAX);
    std::thread::Builder::new().spawn(move || replies.into_iter().for_each(|reply| reply()))?;
    Ok(sender)
}

/// A message, with its time: by that a subscriber knows a message that it has got already.
#[derive(Clone)]
struct Kept {
    bytes: ZBytes,
    time: Timestamp,
    attachment: Option<ZBytes>,
}

/// The last message of a latched output.
type Latch = Arc<Mutex<Option<Kept>>>;

/// What the messages of a publisher of rmw_zenoh have beside them.
struct Attachment {
    /// Of this publisher alone.
    gid: [u8; GID_BYTES],
    /// Messages so far.
    count: AtomicI64,
}

const GID_BYTES: usize = 16;

impl Attachment {
    fn new(session: ZenohId, number: u32) -> Self {
        let id = u128::from_le_bytes(session.to_le_bytes()) ^ (u128::from(number) + 1);
        Self { gid: id.to_le_bytes(), count: AtomicI64::new(0) }
    }

    /// Of the next message: its number, from 1 on, the system's time in ns, and the GID behind its length; little-endian.
    fn next(&self) -> ZBytes {
        let number = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now_ns = i64::try_from(now.as_nanos()).unwrap_or(i64::MAX);
        let mut bytes = Vec::with_capacity(17 + GID_BYTES);
        bytes.extend_from_slice(&number.to_le_bytes());
        bytes.extend_from_slice(&now_ns.to_le_bytes());
        bytes.push(GID_BYTES as u8);
        bytes.extend_from_slice(&self.gid);
        ZBytes::from(bytes)
    }
}

struct Output {
    publisher: Publisher<'static>,
    latch: Option<Latch>,
    attachment: Option<Attachment>,
}

/// A query that waits for its reply.
type Waiting = Arc<Mutex<Option<Query>>>;

struct Service {
    key: KeyExpr<'static>,
    waiting: Waiting,
}

/// What rmw_zenoh wants beside a reply: what stood beside the query, with the time of now.
fn replied_attachment(query: &Query) -> Option<ZBytes> {
    let mut bytes = query.attachment()?.to_bytes().into_owned();
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let now_ns = i64::try_from(now.as_nanos()).unwrap_or(i64::MAX);
    bytes.get_mut(8..16)?.copy_from_slice(&now_ns.to_le_bytes());
    Some(ZBytes::from(bytes))
}

fn reply(query: &Query, key: &KeyExpr<'static>, bytes: impl Into<ZBytes>) -> Result<(), zenoh::Error> {
    query.reply(key, bytes).attachment(replied_attachment(query)).wait()
}

pub struct Zenoh {
    inputs: Vec<KeyExpr<'static>>,
    outputs: Vec<Output>,
    services: Vec<Service>,
    /// What queries get; empty: nothing.
    answers: Vec<Arc<Mutex<ZBytes>>>,
    /// Of a session that answers queries.
    replier: Option<SyncSender<Reply>>,
    /// They live as long as the session.
    tokens: Vec<LivelinessToken>,
    session: Session,
    events: Arc<Events>,
}

/// Zenoh's messages end with the place in its sources.
fn reason_of(error: zenoh::Error) -> Reason {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}

/// `now`, or the next instant after the last message: subscribers drop what is older, and a system's clock may be set back.
fn later(now: Timestamp, last: Option<&Kept>) -> Timestamp {
    match last {
        Some(Kept { time, .. }) if now <= *time => Timestamp::new(NTP64(time.get_time().0 + 1), *time.get_id()),
        _ => now,
    }
}

impl Zenoh {
    fn open(config: Result<Config, zenoh::Error>, events: Arc<Events>) -> Result<Self, Reason> {
        let session = config.and_then(|config| zenoh::open(config).wait()).map_err(reason_of)?;
        Ok(Self {
            inputs: Vec::new(),
            outputs: Vec::new(),
            services: Vec::new(),
            answers: Vec::new(),
            replier: None,
            tokens: Vec::new(),
            session,
            events,
        })
    }

    fn replier(&mut self) -> Result<SyncSender<Reply>, zenoh::Error> {
        let replier = match self.replier.take() {
            Some(replier) => replier,
            None => start_replier()?,
        };
        self.replier = Some(replier.clone());
        Ok(replier)
    }

    fn declare_output(&mut self, number: u32, key: &str, droppable: bool, attaches: bool) -> Result<(), zenoh::Error> {
        let (control, priority) = if droppable {
            (CongestionControl::Drop, Priority::DEFAULT)
        } else {
            (CongestionControl::Block, Priority::RealTime)
        };
        // Not express: that is much slower where several keys are put in a row.
        let output = self
            .session
            .declare_publisher(key.to_owned())
            .congestion_control(control)
            .priority(priority)
            .allowed_destination(Locality::Remote)
            .wait()?;
        let events = self.events.clone();
        output
            .matching_listener()
            .callback(move |status| events.matching(number, status.matching()))
            .background()
            .wait()?;
        let attachment = attaches.then(|| Attachment::new(self.session.zid(), number));
        self.outputs.push(Output { publisher: output, latch: None, attachment });
        Ok(())
    }

    /// Keeps the last message of the output declared last, as an advanced publisher of Zenoh with a cache of one message does:
    /// under this key advanced subscribers ask for it, and by the token they find publishers that come after them.
    fn latch_output(&mut self) -> Result<(), zenoh::Error> {
        let zid = self.session.zid();
        let replier = self.replier()?;
        let output = self.outputs.last_mut().ok_or("there is no output")?;
        let answer = output.publisher.key_expr().clone().into_owned();
        let key = KeyExpr::new(format!("{answer}/@adv/pub/{zid}/uhlc/_"))?;
        let latch: Latch = Arc::default();
        let kept = latch.clone();
        let callback = move |query: Query| {
            let last = kept.lock().ok().and_then(|last| last.clone());
            if let Some(Kept { bytes, time, attachment }) = last {
                let answer = answer.clone();
                let _ = replier.try_send(Box::new(move || {
                    let reply = query.reply(&answer, bytes).timestamp(time).attachment(attachment);
                    let _ = reply.wait(); // refused for a query of its own key alone
                }));
            }
        };
        let queryable = self.session.declare_queryable(key.clone()).callback(callback);
        queryable.allowed_origin(Locality::Remote).background().wait()?;
        output.latch = Some(latch);
        self.tokens.push(self.session.liveliness().declare_token(key).wait()?);
        Ok(())
    }

    fn declare_input(&mut self, number: u32, key: &str) -> Result<(), zenoh::Error> {
        let key = KeyExpr::new(key.to_owned())?;
        let events = self.events.clone();
        let callback = move |sample: Sample| {
            let payload = (sample.kind() == SampleKind::Put).then(|| sample.payload().to_bytes());
            events.sample(number, payload.as_deref());
        };
        self.inputs.push(key.clone());
        let input = self.session.declare_subscriber(key).callback(callback);
        input.allowed_origin(Locality::Remote).background().wait()
    }

    fn declare_strays(&self, key: &str) -> Result<(), zenoh::Error> {
        let events = self.events.clone();
        let inputs = self.inputs.clone();
        let callback = move |sample: Sample| {
            if !inputs.iter().any(|input| input.includes(sample.key_expr())) {
                events.stray();
            }
        };
        let strays = self.session.declare_subscriber(key.to_owned()).callback(callback);
        strays.allowed_origin(Locality::Remote).background().wait()
    }

    fn declare_answer(&mut self, key: &str, bytes: &[u8]) -> Result<(), zenoh::Error> {
        let key = KeyExpr::new(key.to_owned())?;
        let answer = Arc::new(Mutex::new(ZBytes::from(bytes.to_vec())));
        self.answers.push(answer.clone());
        let replier = self.replier()?;
        let own = key.clone();
        let callback = move |query: Query| {
            let bytes = answer.lock().map(|bytes| bytes.clone()).unwrap_or_default(); // shares what is replaced
            if !bytes.is_empty() {
                let own = own.clone();
                let _ = replier.try_send(Box::new(move || {
                    let _ = query.reply(&own, bytes).wait(); // refused for a query that takes only its own key
                }));
            }
        };
        let queryable = self.session.declare_queryable(key).callback(callback);
        queryable.allowed_origin(Locality::Remote).background().wait()
    }

    fn declare_service(&mut self, number: u32, key: &str, most: usize, busy: &[u8]) -> Result<(), zenoh::Error> {
        let key = KeyExpr::new(key.to_owned())?;
        let (own, busy) = (key.clone(), ZBytes::from(busy.to_vec()));
        let waiting = Waiting::default();
        self.services.push(Service { key: key.clone(), waiting: waiting.clone() });
        let replier = self.replier()?;
        let events = self.events.clone();
        let callback = move |query: Query| {
            let mut request = Vec::new();
            if let Some(payload) = query.payload() {
                // One byte more than is taken, so that who counts sees that it is too long.
                let _ = payload.reader().take(most as u64 + 1).read_to_end(&mut request);
            }
            if request.is_empty() || request.len() > most {
                return events.sample(number, (!request.is_empty()).then_some(&request));
            }
            let Ok(mut waiting) = waiting.lock() else { return };
            if waiting.is_some() {
                let (own, busy) = (own.clone(), busy.clone());
                let _ = replier.try_send(Box::new(move || {
                    let _ = reply(&query, &own, busy); // who asked may be gone
                }));
                return;
            }
            *waiting = Some(query);
            drop(waiting);
            events.sample(number, Some(&request));
        };
        let queryable = self.session.declare_queryable(key).complete(true).callback(callback);
        queryable.allowed_origin(Locality::Remote).background().wait()
    }

    fn reply(&self, service: usize, bytes: &[u8]) -> Result<(), Reason> {
        let Service { key, waiting } = self.services.get(service).ok_or("there is no such output")?;
        let query = waiting.lock().map_err(|_| "a query is coming in")?.take().ok_or("no query waits")?;
        let replier = self.replier.as_ref().ok_or("nobody replies")?;
        let (key, bytes) = (key.clone(), bytes.to_vec());
        // Not here: it waits for a slow receiver as long as the query says, and messages wait behind it.
        let send = move || drop(reply(&query, &key, bytes));
        replier.try_send(Box::new(send)).map_err(|_| Reason::from("too many queries wait for their replies"))
    }

    fn answer(&self, answer: u32, bytes: &[u8]) -> Result<(), Reason> {
        let answer = self.answers.get(answer as usize).ok_or("there is no such answer")?;
        let bytes = ZBytes::from(bytes.to_vec());
        *answer.lock().map_err(|_| "the answer is lost")? = bytes;
        Ok(())
    }

    fn declare_token(&mut self, key: &str) -> Result<(), zenoh::Error> {
        let zid = self.session.zid().to_string();
        let key = if key.contains(ZID) { key.replacen(ZID, &zid, 1) } else { format!("{key}/{zid}") };
        self.tokens.push(self.session.liveliness().declare_token(key).wait()?);
        Ok(())
    }

    fn watch_token(&self, number: u32, key: &str) -> Result<(), zenoh::Error> {
        let events = self.events.clone();
        let own = format!("{key}/{}", self.session.zid());
        let alive = Mutex::new(HashSet::new());
        let callback = move |sample: Sample| {
            let Ok(mut alive) = alive.lock() else { return };
            let token = sample.key_expr().as_str();
            if token == own {
                return;
            }
            match sample.kind() {
                SampleKind::Put if alive.len() < TOKENS_MAX => alive.insert(token.to_owned()),
                SampleKind::Put => false,
                SampleKind::Delete => alive.remove(token),
            };
            events.tokens(number, alive.len());
        };
        let watched = self.session.liveliness().declare_subscriber(format!("{key}/*"));
        watched.history(true).callback(callback).background().wait()
    }

    fn put(&self, output: u32, bytes: &[u8]) -> Result<(), Reason> {
        let Some(output) = self.outputs.get(output as usize) else {
            return self.reply(output as usize - self.outputs.len(), bytes);
        };
        let attachment = output.attachment.as_ref().map(Attachment::next);
        let Some(latch) = &output.latch else {
            return output.publisher.put(bytes).attachment(attachment).wait().map_err(reason_of);
        };
        let bytes = ZBytes::from(bytes);
        let mut last = latch.lock().map_err(|_| "a message is being kept")?;
        let time = later(self.session.new_timestamp(), last.as_ref());
        *last = Some(Kept { bytes: bytes.clone(), time, attachment: attachment.clone() });
        drop(last);
        output.publisher.put(bytes).attachment(attachment).timestamp(time).wait().map_err(reason_of)
    }

    /// Waits a little for replies that are under way.
    fn drain(&self) {
        let (done, drained) = sync_channel(1);
        let mark = Box::new(move || drop(done.try_send(())));
        if self.replier.as_ref().is_some_and(|replier| replier.try_send(mark).is_ok()) {
            let _ = drained.recv_timeout(DRAIN); // a slow receiver goes without
        }
    }

    fn peers(&self) -> usize {
        let info = self.session.info();
        info.peers_zid().wait().count() + info.routers_zid().wait().count()
    }
}

/// Runs `action` on a session and turns its result into what C gets.
///
/// # Safety
/// `zenoh` came from fcsl_zenoh_open and was not closed; `key` a string, `error` null or `error_size` writable bytes.
unsafe fn declare(
    zenoh: *mut Zenoh,
    key: *const c_char,
    error: *mut c_char,
    error_size: usize,
    action: impl FnOnce(&mut Zenoh, &str) -> Result<(), zenoh::Error>,
) -> i32 {
    // SAFETY: the caller's promise, and declarations come from one thread at a time.
    let declared = unsafe {
        c::string(key, "the key").and_then(|key| {
            let zenoh = zenoh.as_mut().ok_or("the session is null")?;
            action(zenoh, key).map_err(reason_of)
        })
    };
    match declared {
        Ok(()) => 0,
        Err(reason) => {
            // SAFETY: the caller's promise.
            unsafe { c::message(&reason, error, error_size) };
            -1
        }
    }
}

/// # Safety
/// As zenoh_session.h: strings or null, `events` and `out` not null, `error` null or `error_size` writable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_open(
    path: *const c_char,
    config: *const c_char,
    events: *const Callbacks,
    out: *mut *mut Zenoh,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        let events = Arc::new(Events(*events));
        let config = if path.is_null() {
            c::string(config, "the configuration").map(Config::from_json5)
        } else {
            c::string(path, "the path").map(Config::from_file)
        };
        match config.and_then(|config| Zenoh::open(config, events)) {
            Ok(zenoh) => {
                *out = Box::into_raw(Box::new(zenoh));
                0
            }
            Err(reason) => {
                c::message(&reason, error, error_size);
                -1
            }
        }
    }
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_output(
    zenoh: *mut Zenoh,
    number: u32,
    key: *const c_char,
    droppable: i32,
    latched: i32,
    attaches: i32,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe {
        declare(zenoh, key, error, error_size, |zenoh, key| {
            zenoh.declare_output(number, key, droppable != 0, attaches != 0)?;
            if latched != 0 {
                zenoh.latch_output()?;
            }
            Ok(())
        })
    }
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_input(
    zenoh: *mut Zenoh,
    number: u32,
    key: *const c_char,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe { declare(zenoh, key, error, error_size, |zenoh, key| zenoh.declare_input(number, key)) }
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_strays(
    zenoh: *mut Zenoh,
    key: *const c_char,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe { declare(zenoh, key, error, error_size, |zenoh, key| zenoh.declare_strays(key)) }
}

/// # Safety
/// As zenoh_session.h: `size` readable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_answer(
    zenoh: *mut Zenoh,
    key: *const c_char,
    bytes: *const u8,
    size: usize,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe {
        let bytes = c::bytes(bytes, size, "the answer");
        declare(zenoh, key, error, error_size, |zenoh, key| zenoh.declare_answer(key, bytes?))
    }
}

/// # Safety
/// As zenoh_session.h: `busy_size` readable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_service(
    zenoh: *mut Zenoh,
    number: u32,
    key: *const c_char,
    most: usize,
    busy: *const u8,
    busy_size: usize,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe {
        let busy = c::bytes(busy, busy_size, "the answer");
        declare(zenoh, key, error, error_size, |zenoh, key| zenoh.declare_service(number, key, most, busy?))
    }
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_declare_token(
    zenoh: *mut Zenoh,
    key: *const c_char,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe { declare(zenoh, key, error, error_size, |zenoh, key| zenoh.declare_token(key)) }
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_watch_token(
    zenoh: *mut Zenoh,
    number: u32,
    key: *const c_char,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract.
    unsafe { declare(zenoh, key, error, error_size, |zenoh, key| zenoh.watch_token(number, key)) }
}

/// # Safety
/// As zenoh_session.h: `size` readable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_put(zenoh: *const Zenoh, output: u32, bytes: *const u8, size: usize) -> i32 {
    // SAFETY: the header's contract.
    let put = unsafe {
        c::bytes(bytes, size, "the message").and_then(|bytes| {
            let zenoh = zenoh.as_ref().ok_or("the session is null")?;
            zenoh.put(output, bytes)
        })
    };
    -i32::from(put.is_err())
}

/// # Safety
/// As zenoh_session.h: `size` readable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_answer(zenoh: *const Zenoh, answer: u32, bytes: *const u8, size: usize) -> i32 {
    // SAFETY: the header's contract.
    let answered = unsafe {
        c::bytes(bytes, size, "the answer").and_then(|bytes| {
            let zenoh = zenoh.as_ref().ok_or("the session is null")?;
            zenoh.answer(answer, bytes)
        })
    };
    -i32::from(answered.is_err())
}

/// # Safety
/// As zenoh_session.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_peers(zenoh: *const Zenoh) -> u32 {
    // SAFETY: the header's contract.
    unsafe { zenoh.as_ref() }.map_or(0, |zenoh| zenoh.peers() as u32)
}

/// # Safety
/// As zenoh_session.h; `zenoh` is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fcsl_zenoh_close(zenoh: *mut Zenoh) {
    if zenoh.is_null() {
        return;
    }
    // SAFETY: not null, came from Box::into_raw in fcsl_zenoh_open, and ownership ends here.
    let zenoh = unsafe { Box::from_raw(zenoh) };
    zenoh.drain();
    let _ = zenoh.session.close().wait(); // a timeout: there is nothing to do about it
}
