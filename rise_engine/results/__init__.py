"""The results of sessions and studies: analysis, exports, reports and bundles."""
