"""A sweep's store in an object store of the S3 kind: copied there, and read there."""

import pytest
import xarray as xr

import jointplay as jp

AXES = 'c = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "0.2 mm", "0.3 mm"] }'


@pytest.fixture
def bucket(monkeypatch):
    """An empty bucket of a server on this machine, and how to reach it."""
    import s3fs
    from moto import server

    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    running.start()
    host, port = running.get_host_and_port()
    options = {"endpoint_url": f"http://{host}:{port}"}
    files = s3fs.S3FileSystem(**options, use_listings_cache=False)
    files.mkdir("studies")
    yield files, options
    running.stop()


@pytest.mark.needs("moto", "s3fs")
def test_a_store_copied_to_an_object_store_reads_the_same(bucket, swept, tmp_path):
    files, options = bucket
    jp.sweep(swept(AXES, 'histories = ["tool_position"]', "5 ms"), tmp_path / "study.zarr", jobs=1)
    files.put(str(tmp_path / "study.zarr"), "studies/study.zarr", recursive=True)
    there = xr.open_zarr(
        "s3://studies/study.zarr", storage_options=options, chunks=None, zarr_format=3,
        mask_and_scale=False,
    )  # fmt: skip
    here = xr.open_zarr(tmp_path / "study.zarr", chunks=None, zarr_format=3, mask_and_scale=False)
    xr.testing.assert_identical(there.load(), here.load())
    assert (there["state"] == 1).all()
    # And back, with all its seals.
    files.get("studies/study.zarr", str(tmp_path / "back.zarr"), recursive=True)
    whole = jp.study.open_sweep(tmp_path / "back.zarr").load()
    kept = jp.study.open_sweep(tmp_path / "study.zarr").load()
    xr.testing.assert_identical(whole, kept)


@pytest.mark.parametrize("place", ["s3://studies/study.zarr", "gs://studies/study.zarr"])
def test_a_sweep_into_an_object_store_is_refused_with_the_way_there(place, swept, tmp_path):
    with pytest.raises(jp.JointplayError, match="copy the finished store"):
        jp.sweep(swept(AXES), place, jobs=1)
    assert not list(tmp_path.glob("*:*"))
