//! One connection to an MQTT broker, from its acceptance to its end. MQTT 5, because only there a broker says what it refuses.

use std::{
    future::Future,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, LastWill, MqttOptions, Packet, PubAckReason, Publish,
    PublishNoticeError, PublishOptions, PublishProperties, QoS, SubscribeFilterInput, TlsConfiguration, Transport,
    tokio_rustls::rustls::{
        RootCertStore,
        pki_types::{CertificateDer, pem::PemObject},
    },
};
use tokio::{
    sync::{mpsc, oneshot},
    task::JoinHandle,
    time::timeout,
};

use crate::{
    bus::io::worker::spawn_blocking,
    north::{
        payload::{self, Message},
        request::{self, PACKET_MAX, Received},
    },
    plant::def::{MqttDef, PasswordSource, TlsRoots},
    profile::io::regular,
};

/// A broker that is asked to accept the station has so long.
const CONNECT_MAX: Duration = Duration::from_secs(15);
/// A broker that is asked to keep a message has so long.
const ACKNOWLEDGE_MAX: Duration = Duration::from_secs(30);
/// A broker that does not answer for this long is gone, seconds; half as much again until it says so itself.
const KEEP_ALIVE_S: u16 = 20;
/// Messages on their way to the connection.
const QUEUE_MAX: usize = 16;

/// Where messages on the topics of requests go. The connection never waits for it.
#[derive(Debug, Clone)]
pub struct Inbox {
    queue: mpsc::Sender<Received>,
    lost: Arc<AtomicU64>,
}

impl Inbox {
    /// `lost` counts what the queue had no room for.
    pub fn new(queue: mpsc::Sender<Received>, lost: Arc<AtomicU64>) -> Inbox {
        Inbox { queue, lost }
    }

    fn put(&self, publish: Publish) {
        let Publish { retain, topic, payload, properties, .. } = publish;
        let PublishProperties { response_topic, correlation_data, .. } = properties.unwrap_or_default();
        let received = Received {
            topic: String::from_utf8_lossy(&topic).into_owned(),
            payload: payload.into(),
            retained: retain,
            response_topic,
            correlation: correlation_data.map(Into::into),
        };
        if self.queue.try_send(received).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A connection that the broker has accepted.
pub struct Broker {
    client: AsyncClient,
    /// Moves bytes; its result is why the connection ended.
    connection: JoinHandle<String>,
}

impl Broker {
    /// Connects, and says that the station is there; requests go to the inbox, if there is one. The error is for people.
    pub async fn connect(def: &MqttDef, inbox: Option<&Inbox>) -> Result<Broker, String> {
        let own = def.clone();
        // Its password and certificates may lie on a disk that hangs.
        let options = spawn_blocking(move || options(&own)).await.map_err(|error| error.to_string())??;
        let (client, events) = AsyncClient::builder(options).capacity(QUEUE_MAX).build();
        let (accepted, is_accepted) = oneshot::channel();
        let mut broker = Broker { client, connection: tokio::spawn(drive(events, accepted, inbox.cloned())) };
        let accepted = broker.unless_ended(is_accepted);
        match timeout(CONNECT_MAX, accepted).await {
            Ok(Ok(Ok(()))) => {}
            Ok(Ok(Err(_))) => return Err(broker.ended().await),
            Ok(Err(why)) => return Err(why),
            Err(_) => return Err(format!("the broker has not answered for {} s", CONNECT_MAX.as_secs())),
        }
        broker.publish(&[payload::status(def, true)]).await?;
        Ok(broker)
    }

    /// Asks for the requests. What was sent before is not delivered: the connection began clean. The error is for people.
    pub async fn subscribe(&mut self, def: &MqttDef) -> Result<(), String> {
        let client = self.client.clone();
        // What is retained arrives as such, and is refused.
        let filter = SubscribeFilterInput::new(request::filter(def), QoS::AtLeastOnce).preserve_retain(true);
        let notice = self.within(client.subscribe_many_tracked([filter])).await?.map_err(|error| error.to_string())?;
        // Only the completion knows what the broker refuses; the packet alone counts as an answer.
        self.within(notice.wait_completion_async()).await?.map_err(|error| error.to_string())
    }

    /// Publishes over this connection, without the others waiting.
    pub fn client(&self) -> AsyncClient {
        self.client.clone()
    }

    /// Publishes messages and waits until the broker has all of them. Returns how many it will never take.
    pub async fn publish(&mut self, messages: &[Message]) -> Result<u64, String> {
        let mut notices = Vec::with_capacity(messages.len());
        for message in messages {
            let client = self.client.clone();
            let queued =
                client.publish_tracked(message.topic.clone(), message.payload.clone(), publish_options(message));
            notices.push(self.within(queued).await?.map_err(|error| error.to_string())?);
        }
        let mut refused = 0;
        for notice in notices {
            match self.within(notice.wait_completion_async()).await? {
                Ok(()) => {}
                Err(PublishNoticeError::V5PubAck(reason)) if is_final(reason) => refused += 1,
                Err(PublishNoticeError::V5PubAck(reason)) => return Err(format!("the broker refuses: {reason:?}")),
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(refused)
    }

    /// Says that the station goes, and goes.
    pub async fn leave(mut self, def: &MqttDef) {
        if self.publish(&[payload::status(def, false)]).await.is_ok() && self.client.disconnect().await.is_ok() {
            self.ended().await;
        }
    }

    async fn within<T>(&mut self, work: impl Future<Output = T>) -> Result<T, String> {
        let none = || format!("the broker has not acknowledged for {} s", ACKNOWLEDGE_MAX.as_secs());
        timeout(ACKNOWLEDGE_MAX, self.unless_ended(work)).await.map_err(|_| none())?
    }

    async fn unless_ended<T>(&mut self, work: impl Future<Output = T>) -> Result<T, String> {
        tokio::select! {
            biased;
            done = work => Ok(done),
            why = &mut self.connection => Err(why.unwrap_or_else(|error| error.to_string())),
        }
    }

    /// Why it ended.
    async fn ended(&mut self) -> String {
        (&mut self.connection).await.unwrap_or_else(|error| error.to_string())
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        self.connection.abort();
    }
}

/// How a message is published.
pub(super) fn publish_options(message: &Message) -> PublishOptions {
    let options = PublishOptions::at_least_once().retain(message.retained);
    match &message.correlation {
        None => options,
        Some(data) => {
            options.properties(PublishProperties { correlation_data: Some(data.clone().into()), ..Default::default() })
        }
    }
}

/// Will it be refused again, however often it is sent?
fn is_final(reason: PubAckReason) -> bool {
    match reason {
        PubAckReason::TopicNameInvalid | PubAckReason::PayloadFormatInvalid => true,
        PubAckReason::Success
        | PubAckReason::NoMatchingSubscribers
        | PubAckReason::UnspecifiedError
        | PubAckReason::ImplementationSpecificError
        | PubAckReason::NotAuthorized
        | PubAckReason::PacketIdentifierInUse
        | PubAckReason::QuotaExceeded => false,
    }
}

/// Moves bytes until the connection ends.
async fn drive(mut events: EventLoop, accepted: oneshot::Sender<()>, inbox: Option<Inbox>) -> String {
    let mut accepted = Some(accepted);
    loop {
        match events.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(_))) => {
                // Nothing waits for it any more after its time.
                let _ = accepted.take().map(|accepted| accepted.send(()));
            }
            Ok(Event::Incoming(Packet::Disconnect(why))) => return format!("the broker ends: {:?}", why.reason_code),
            Ok(Event::Incoming(Packet::Publish(publish))) => {
                if let Some(inbox) = &inbox {
                    inbox.put(publish);
                }
            }
            Ok(_) => {}
            Err(ConnectionError::ConnectionRefused(code)) => return format!("the broker refuses: {code:?}"),
            Err(ConnectionError::Io(error)) => return error.to_string(),
            Err(error) => return error.to_string(),
        }
    }
}

fn options(def: &MqttDef) -> Result<MqttOptions, String> {
    let mut options = MqttOptions::new(def.client_id.clone(), (def.host.clone(), def.port));
    let Message { topic, payload, retained, correlation: _ } = payload::status(def, false);
    options.set_keep_alive(KEEP_ALIVE_S).set_clean_start(true).set_max_packet_size(Some(PACKET_MAX));
    options.set_last_will(LastWill::new(topic, payload, QoS::AtLeastOnce, retained, None));
    if let Some(user) = &def.user {
        let password = def.password.as_ref().map(password).transpose()?.unwrap_or_default();
        options.set_credentials(user.clone(), password);
    }
    if let Some(roots) = &def.tls {
        options.set_transport(Transport::Tls(tls(roots)?));
    }
    Ok(options)
}

/// Of the file of a password, and of certificates.
const PASSWORD_BYTES_MAX: u64 = 64 << 10;
const ROOTS_BYTES_MAX: u64 = 16 << 20;

fn password(source: &PasswordSource) -> Result<String, String> {
    match source {
        PasswordSource::File(path) => {
            let text = regular::read_text(path, PASSWORD_BYTES_MAX);
            let text = text.map_err(|error| format!("the password in {}: {error}", path.display()))?;
            Ok(text.lines().next().unwrap_or_default().to_owned())
        }
        PasswordSource::Environment(name) => {
            std::env::var(name).map_err(|error| format!("the password in the variable {name}: {error}"))
        }
    }
}

fn tls(roots: &TlsRoots) -> Result<TlsConfiguration, String> {
    match roots {
        TlsRoots::File(path) => {
            let ca = regular::read(path, ROOTS_BYTES_MAX).map_err(|error| error.to_string());
            let ca = ca.and_then(|ca| check_roots(&ca).map(|()| ca));
            let ca = ca.map_err(|error| format!("the certificates in {}: {error}", path.display()))?;
            Ok(TlsConfiguration::Simple { ca, alpn: None, client_auth: None })
        }
        TlsRoots::System => TlsConfiguration::try_default_rustls().map_err(|error| error.to_string()),
    }
}

/// Whether there are certificates, all of them sound: what the connection says of others does not name their file.
fn check_roots(pem: &[u8]) -> Result<(), String> {
    let mut roots = RootCertStore::empty();
    for (place, found) in CertificateDer::pem_slice_iter(pem).enumerate() {
        let sound = found.ok().and_then(|found| roots.add(found).ok());
        sound.ok_or_else(|| format!("expected PEM, found number {} damaged", place + 1))?;
    }
    if roots.is_empty() { Err("expected PEM, found none".to_owned()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certificates_that_are_none_are_named_with_their_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ca.pem");
        let begin = "-----BEGIN CERTIFICATE-----\nAAAA\n";
        for (content, expect) in [
            ("", "expected PEM, found none"),
            ("no certificate", "expected PEM, found none"),
            (begin, "expected PEM, found number 1 damaged"),
            (&format!("{begin}-----END CERTIFICATE-----\n"), "expected PEM, found number 1 damaged"),
        ] {
            std::fs::write(&path, content).expect("written");
            let refused = tls(&TlsRoots::File(path.clone())).err();
            assert_eq!(refused, Some(format!("the certificates in {}: {expect}", path.display())), "{content}");
        }
    }
}
