//! The task that sends the answers to requests, one after the other, over whichever connection there is.

use std::time::Duration;

use rumqttc::{AsyncClient, ClientError, PublishNoticeError};
use tokio::{
    sync::{mpsc, watch},
    time::timeout,
};

use super::broker::publish_options;
use crate::north::payload::Message;

/// A broker that is asked to keep an answer has so long; then it is sent again.
const ACKNOWLEDGE_MAX: Duration = Duration::from_secs(30);

/// Runs until no answer can come any more, or no connection. What the broker refuses is not sent again.
pub(crate) async fn run(mut answers: mpsc::Receiver<Message>, mut clients: watch::Receiver<Option<AsyncClient>>) {
    while let Some(answer) = answers.recv().await {
        loop {
            let Ok(client) = clients.wait_for(Option::is_some).await.map(|client| client.clone()) else { return };
            let Some(client) = client else { continue };
            clients.mark_unchanged();
            match timeout(ACKNOWLEDGE_MAX, publish(&client, &answer)).await {
                Ok(Sent::Done) => break,
                Ok(Sent::ConnectionEnded) => {
                    if clients.changed().await.is_err() {
                        return;
                    }
                }
                Err(_) => {}
            }
        }
    }
}

enum Sent {
    Done,
    ConnectionEnded,
}

async fn publish(client: &AsyncClient, answer: &Message) -> Sent {
    let queued = client.publish_tracked(answer.topic.clone(), answer.payload.clone(), publish_options(answer)).await;
    let notice = match queued {
        Ok(notice) => notice,
        Err(error @ ClientError::InvalidRequest(_)) => return refused(answer, &error),
        Err(_) => return Sent::ConnectionEnded,
    };
    match notice.wait_async().await {
        Ok(_) => Sent::Done,
        Err(error @ PublishNoticeError::V5PubAck(_)) => refused(answer, &error),
        Err(_) => Sent::ConnectionEnded,
    }
}

fn refused(answer: &Message, error: &dyn std::fmt::Display) -> Sent {
    tracing::warn!(%error, topic = answer.topic, "an answer to a request cannot be sent");
    Sent::Done
}
