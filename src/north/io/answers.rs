//! The task that sends the answers to requests, one after the other, over whichever connection there is.

use std::time::Duration;

use rumqttc::{AsyncClient, ClientError, PublishNoticeError};
use tokio::{
    sync::{mpsc, watch},
    time::timeout,
};

use super::broker::publish_options;
use crate::north::{payload::Message, request::shown};

/// A broker that is asked to keep an answer has so long; then it is sent again.
const ACKNOWLEDGE_MAX: Duration = Duration::from_secs(30);

/// What became of the answers.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct AnswerStatus {
    /// Answers that the broker has refused since the start.
    pub refused: u64,
    /// Why it refused the last one; `None` if it has that.
    pub error: Option<String>,
}

/// Runs until no answer can come any more, or no connection. What the broker refuses is not sent again.
pub(crate) async fn run(
    mut answers: mpsc::Receiver<Message>,
    mut clients: watch::Receiver<Option<AsyncClient>>,
    publish_status: watch::Sender<AnswerStatus>,
) {
    while let Some(answer) = answers.recv().await {
        loop {
            let Ok(client) = clients.wait_for(Option::is_some).await.map(|client| client.clone()) else { return };
            let Some(client) = client else { continue };
            clients.mark_unchanged();
            match timeout(ACKNOWLEDGE_MAX, publish(&client, &answer)).await {
                Ok(Sent::Done) => {
                    publish_status.send_if_modified(|status| status.error.take().is_some());
                    break;
                }
                Ok(Sent::Refused(why)) => {
                    tracing::warn!(why, topic = answer.topic, "the broker refuses an answer to a request");
                    let error = format!("the broker refuses answers on {}: {why}", shown(&answer.topic));
                    publish_status.send_modify(|status| {
                        *status = AnswerStatus { refused: status.refused + 1, error: Some(error) };
                    });
                    break;
                }
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
    Refused(String),
    ConnectionEnded,
}

async fn publish(client: &AsyncClient, answer: &Message) -> Sent {
    let queued = client.publish_tracked(answer.topic.clone(), answer.payload.clone(), publish_options(answer)).await;
    let notice = match queued {
        Ok(notice) => notice,
        Err(error @ ClientError::InvalidRequest(_)) => return Sent::Refused(error.to_string()),
        Err(_) => return Sent::ConnectionEnded,
    };
    match notice.wait_completion_async().await {
        Ok(()) => Sent::Done,
        Err(PublishNoticeError::V5PubAck(reason)) => Sent::Refused(format!("{reason:?}")),
        Err(_) => Sent::ConnectionEnded,
    }
}
