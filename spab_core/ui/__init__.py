"""What Streamlit pages share; nothing outside this package imports Streamlit."""
