//! The files of the socket: made, guarded, removed, made again.

use super::*;

#[tokio::test(start_paused = true)]
async fn a_second_station_is_refused_and_a_dead_socket_replaced() {
    let stand = Stand::start();
    let mode = std::fs::metadata(stand.path()).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o660);
    let error = listen(&stand.path()).unwrap_err();
    assert!(matches!(error, ListenError::Running { .. }));
    assert_eq!(error.to_string(), format!("the station is already running, process {}", std::process::id()));
    let path = stand.path();
    let places = SocketFolders {
        given: Some(stand.folder.path().into()),
        service: "/nowhere".into(),
        login: None,
        last: "/nowhere".into(),
    };
    let living: Vec<String> = places.living().await.into_iter().map(|found| found.name).collect();
    assert_eq!(living, ["tank"]);
    let folder = stand.end().await;
    assert!(!path.exists(), "a station takes its socket with it");

    // As kill -9 leaves it: a name without a listener.
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    assert!(path.exists() && places.living().await.is_empty());
    assert!(matches!(connect(&path).await, Err(AttachError::NoStation { .. })));
    let stand = Stand::start_in(folder);
    stand.session().await;
    assert_eq!(places.socket("tank").unwrap(), path);
}

#[tokio::test(start_paused = true)]
async fn a_folder_writable_by_others_gets_no_passwords() {
    let folder = folder();
    let last = folder.path().join("sightglass-1");
    let places = SocketFolders { given: None, service: "/nowhere".into(), login: None, last: last.clone() };
    assert_eq!(places.socket("tank").unwrap(), last.join("tank.sock"));
    assert_eq!(std::fs::metadata(&last).unwrap().permissions().mode() & 0o777, 0o700);
    std::fs::set_permissions(&last, std::fs::Permissions::from_mode(0o777)).unwrap();
    let _listener = std::os::unix::net::UnixListener::bind(last.join("tank.sock")).unwrap();
    assert!(places.socket("tank").is_err() && places.living().await.is_empty());
    std::fs::set_permissions(&last, std::fs::Permissions::from_mode(0o700)).unwrap();
    assert_eq!(places.living().await.len(), 1);
}

#[tokio::test(start_paused = true)]
async fn a_removed_socket_is_made_again_and_who_is_attached_stays() {
    let mut stand = Stand::start();
    let mut session = stand.session().await;
    for removed in [vec![".lock"], vec![""], vec!["", ".lock"]] {
        for ending in &removed {
            std::fs::remove_file(format!("{}{ending}", stand.path().display())).unwrap();
        }
        // Only time passes; the station looks for its socket from time to time.
        let began = tokio::time::Instant::now();
        while ["", ".lock"]
            .iter()
            .any(|ending| !std::fs::exists(format!("{}{ending}", stand.path().display())).unwrap())
        {
            assert!(began.elapsed() < TIMEOUT, "{removed:?}");
            tokio::time::advance(Duration::from_secs(1)).await;
        }
        let another = stand.session().await;
        stand.until_present(2).await;
        drop(another);
        stand.until_present(1).await;
        assert!(
            removed == [".lock"] || matches!(listen(&stand.path()), Err(ListenError::Running { .. })),
            "{removed:?}"
        );
    }
    stand.set(1.0);
    sees(&mut session, 1.0).await;
}

#[tokio::test(start_paused = true)]
async fn a_removed_folder_of_the_socket_is_made_again_with_its_rights() {
    let folder = folder();
    std::fs::set_permissions(folder.path(), std::fs::Permissions::from_mode(0o750)).unwrap();
    let mut stand = Stand::start_in(folder);
    let mut session = stand.session().await;
    std::fs::remove_dir_all(stand.folder.path()).unwrap();
    let began = tokio::time::Instant::now();
    while !std::fs::exists(stand.path()).unwrap() {
        assert!(began.elapsed() < TIMEOUT);
        tokio::time::advance(Duration::from_secs(1)).await;
    }
    let mode = std::fs::metadata(stand.folder.path()).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o750, "group may enter, others may not");
    let _another = stand.session().await;
    stand.until_present(2).await;
    assert!(matches!(listen(&stand.path()), Err(ListenError::Running { .. })), "its lock is back too");
    stand.set(1.0);
    sees(&mut session, 1.0).await;
}
