"""Reads an archive as it lies with an engine: `archive.py ENGINE FOLDER` prints rows and sums of it, the same for each."""

import sys

RAW = """SELECT (SELECT count(*) FROM {raw}) AS all_rows, round(sum(value) * 10) AS total, count(*) AS own, min(utc) AS begin, max(utc) AS last
FROM {raw} s JOIN {tag} t ON s.tag = t.id WHERE t.name = 'TIC-1.PV'"""
MINUTES = """SELECT count(*) AS minutes, round(sum(mean * good_ms) / 100) AS total, sum(n) AS samples
FROM {m1} s JOIN {tag} t ON s.tag = t.id WHERE t.name = 'TIC-1.PV'"""


def polars(folder):
    import polars

    tags = polars.read_parquet(f"{folder}/tag.parquet")
    pv = tags.filter(polars.col("name") == "TIC-1.PV")["id"].item()
    raw = polars.scan_parquet(f"{folder}/raw/**/*.parquet").collect()
    one = raw.filter(polars.col("tag") == pv)
    m1 = polars.scan_parquet(f"{folder}/m1/**/*.parquet").filter(polars.col("tag") == pv).collect()
    good = (m1["mean"] * m1["good_ms"]).sum() / 100
    return [raw.height, one["value"].sum() * 10, one.height, one["utc"].min(), one["utc"].max(), m1.height, good, m1["n"].sum()]


def pyarrow(folder):
    import pyarrow.compute as compute
    import pyarrow.dataset as dataset

    is_pv = compute.field("name") == "TIC-1.PV"
    pv = compute.field("tag") == dataset.dataset(f"{folder}/tag.parquet").to_table(filter=is_pv)["id"][0]
    raw = dataset.dataset(f"{folder}/raw", partitioning="hive").to_table()
    one = raw.filter(pv)
    m1 = dataset.dataset(f"{folder}/m1", partitioning="hive").to_table(filter=pv)
    good = compute.sum(compute.multiply(m1["mean"], m1["good_ms"].cast("float64"))).as_py() / 100
    ends = [compute.min(one["utc"]).as_py(), compute.max(one["utc"]).as_py()]
    values = [raw.num_rows, compute.sum(one["value"]).as_py() * 10, one.num_rows]
    return values + ends + [m1.num_rows, good, compute.sum(m1["n"]).as_py()]


def both(ask, **tables):
    return [*ask(RAW.format(**tables)), *ask(MINUTES.format(**tables))]


def duckdb(folder):
    import duckdb

    def files(tier):
        return f"read_parquet('{folder}/{tier}/**/*.parquet')"

    tag = f"read_parquet('{folder}/tag.parquet')"
    return both(lambda sql: duckdb.sql(sql).fetchall()[0], raw=files("raw"), m1=files("m1"), tag=tag)


def datafusion(folder):
    from datafusion import SessionContext

    context = SessionContext()
    for name, path in [("raw", "raw/"), ("m1", "m1/"), ("tags", "tag.parquet")]:
        context.register_parquet(name, f"{folder}/{path}")
    return both(lambda sql: context.sql(sql).to_pylist()[0].values(), raw="raw", m1="m1", tag="tags")


def clickhouse(folder):
    import ast

    import chdb

    def files(path):
        return f"file('{folder}/{path}', Parquet)"

    def ask(sql):
        return ast.literal_eval(str(chdb.query(sql, "CSV")).strip())

    return both(ask, raw=files("raw/**/*.parquet"), m1=files("m1/**/*.parquet"), tag=files("tag.parquet"))


def spark(folder):
    from pyspark.sql import SparkSession

    settings = {"spark.ui.enabled": "false", "spark.sql.session.timeZone": "UTC", "spark.driver.host": "127.0.0.1"}
    session = SparkSession.builder.master("local[1]").config(map=settings).getOrCreate()
    session.sparkContext.setLogLevel("ERROR")
    for name, path in [("raw", "raw"), ("m1", "m1"), ("tags", "tag.parquet")]:
        session.read.parquet(f"{folder}/{path}").createOrReplaceTempView(name)
    return both(lambda sql: session.sql(sql).first(), raw="raw", m1="m1", tag="tags")


def word(value):
    return f"{value:.0f}" if isinstance(value, float) else str(value)[:19]


engine, folder = sys.argv[1:]
print(" ".join(word(value) for value in globals()[engine](folder)))
