//! One connection to an MQTT broker, from its acceptance to its end. MQTT 5, because only there a broker says what it refuses.

use std::{future::Future, time::Duration};

use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, LastWill, MqttOptions, Packet, PubAckReason, PublishNoticeError,
    PublishOptions, QoS, TlsConfiguration, Transport,
};
use tokio::{sync::oneshot, task::JoinHandle, time::timeout};

use crate::{
    north::payload::{self, Message},
    plant::def::{MqttDef, PasswordSource, TlsRoots},
};

/// A broker that is asked to accept the station has so long.
const CONNECT_MAX: Duration = Duration::from_secs(15);
/// A broker that is asked to keep a message has so long.
const ACKNOWLEDGE_MAX: Duration = Duration::from_secs(30);
/// A broker that does not answer for this long is gone, seconds; half as much again until it says so itself.
const KEEP_ALIVE_S: u16 = 20;
/// Messages on their way to the connection.
const QUEUE_MAX: usize = 16;

/// A connection that the broker has accepted.
pub struct Broker {
    client: AsyncClient,
    /// Moves bytes; its result is why the connection ended.
    connection: JoinHandle<String>,
}

impl Broker {
    /// Connects, and says that the station is there. The error is for people.
    pub async fn connect(def: &MqttDef) -> Result<Broker, String> {
        let (client, events) = AsyncClient::builder(options(def)?).capacity(QUEUE_MAX).build();
        let (accepted, is_accepted) = oneshot::channel();
        let mut broker = Broker { client, connection: tokio::spawn(drive(events, accepted)) };
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

    /// Publishes messages and waits until the broker has all of them. Returns how many it will never take.
    pub async fn publish(&mut self, messages: &[Message]) -> Result<u64, String> {
        let mut notices = Vec::with_capacity(messages.len());
        for Message { topic, payload, retained } in messages {
            let options = PublishOptions::at_least_once().retain(*retained);
            let client = self.client.clone();
            let queued = client.publish_tracked(topic.clone(), payload.clone(), options);
            notices.push(self.within(queued).await?.map_err(|error| error.to_string())?);
        }
        let mut refused = 0;
        for notice in notices {
            match self.within(notice.wait_async()).await? {
                Ok(_) => {}
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
async fn drive(mut events: EventLoop, accepted: oneshot::Sender<()>) -> String {
    let mut accepted = Some(accepted);
    loop {
        match events.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(_))) => {
                // Nothing waits for it any more after its time.
                let _ = accepted.take().map(|accepted| accepted.send(()));
            }
            Ok(Event::Incoming(Packet::Disconnect(why))) => return format!("the broker ends: {:?}", why.reason_code),
            Ok(_) => {}
            Err(ConnectionError::ConnectionRefused(code)) => return format!("the broker refuses: {code:?}"),
            Err(ConnectionError::Io(error)) => return error.to_string(),
            Err(error) => return error.to_string(),
        }
    }
}

fn options(def: &MqttDef) -> Result<MqttOptions, String> {
    let mut options = MqttOptions::new(def.client_id.clone(), (def.host.clone(), def.port));
    let Message { topic, payload, retained } = payload::status(def, false);
    options.set_keep_alive(KEEP_ALIVE_S).set_clean_start(true);
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

fn password(source: &PasswordSource) -> Result<String, String> {
    match source {
        PasswordSource::File(path) => {
            let text = std::fs::read_to_string(path);
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
            let ca = std::fs::read(path).map_err(|error| format!("the certificates in {}: {error}", path.display()))?;
            Ok(TlsConfiguration::Simple { ca, alpn: None, client_auth: None })
        }
        TlsRoots::System => TlsConfiguration::try_default_rustls().map_err(|error| error.to_string()),
    }
}
